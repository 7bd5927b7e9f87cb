#pragma once
// A worker: what worker/worker.cc does, over simulated streams and time. What it keeps, sends again
// and has acknowledged is the real worker::HeldAttempt; what it computes is a closed formula.

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "tests/simulation/dice.h"
#include "tests/simulation/wire.h"
#include "worker/held_attempt.h"

namespace calib::simulation {

/// What a worker meets outside of itself.
class Surroundings {
 public:
  virtual ~Surroundings() = default;
  /// A stream to the server, which may be down: then it is cut already.
  virtual std::shared_ptr<Stream> Open(int worker) = 0;
  virtual milliseconds Delay() = 0;
  /// Between two states of a run.
  virtual milliseconds Pace() = 0;
  /// Whether the node fails a run now; whether a run says that it is complete and is not.
  virtual bool NodeFails() = 0;
  virtual bool IsHasty() = 0;
  /// States of an attempt that a worker has come to.
  virtual void Reached(std::int64_t attempt, int states) = 0;
};

/// Not thread-safe.
class WorkerProcess {
 public:
  struct Options {
    int number = 0;
    std::string name{};
    int slots = 1;
    /// Load steps behind runs that can go on, by run; with its name, others may share it.
    std::string folder_name{};
    std::shared_ptr<std::map<std::string, int>> folder{};
  };
  WorkerProcess(const Clocks& clocks, Surroundings& surroundings, Options options)
      : clocks_(clocks), surroundings_(surroundings), options_(std::move(options)) {}

  /// A new process; what runs rest in may be there from before.
  void Start();
  /// kill -9.
  void Kill();
  bool runs() const { return process_ != nullptr; }
  /// SIGTERM with --drain-within; nothing: without.
  void Signal(std::optional<milliseconds> within);
  void LoseFolder() { options_.folder->clear(); }
  /// Before a Start().
  void SetSlots(int slots) { options_.slots = slots; }

  /// The next message, or that the stream has ended.
  void Receive(const v1::ServerMessage& message);
  void Closed(const absl::Status& status);
  const std::shared_ptr<Stream>& stream() const;

  /// When something is to be done of its own accord; doing that.
  Time next() const;
  void Go();

  Time frozen_until{};
  const Options& options() const { return options_; }
  std::size_t holds() const;

 private:
  struct Run {
    explicit Run(const v1::Lease& leased) : held(leased), lease(leased) {}
    worker::HeldAttempt held;
    v1::Lease lease;
    bool started = false;
    bool ended = false;
    bool leaves = false;  ///< with its next state
    int reached = 0;
    int until = 0;
    Time due{};  ///< of its next state, or its end
    bool running() const { return started && !ended; }
  };
  struct Process {
    std::string instance{};
    std::shared_ptr<Stream> stream{};
    bool open = false;
    bool welcome = false;
    bool draining = false;
    bool leaving = false;
    bool stopping = false;
    int tries = 0;
    milliseconds heartbeat_every{1000};
    milliseconds gather_for{0};
    std::optional<Time> heartbeat{}, gather{}, reconnect{}, farewell{};
    std::map<std::int64_t, Run> held{};
    std::map<std::int64_t, Time> ending{};
  };

  void Connect();
  void Welcome(const v1::Welcome& welcome);
  void Beat();
  void Say(v1::WorkerMessage message);
  void Send(Run& run);
  void SendGathered();
  void Take(const v1::Lease& lease);
  void EndWithout(Run& run, v1::Finished::Outcome outcome, const std::string& reason);
  void StartWaiting();
  void Advance(std::int64_t id, Run& run);
  void End(Run& run, v1::Finished::Outcome outcome, const std::string& reason);
  void Acknowledged(const v1::Ack& ack);
  void Drop(std::int64_t id);
  void DrainWithin(milliseconds within);
  void Stop();
  void LeaveIfDrained();
  void FarewellIfStopped();
  void Leave();
  void Quit() { quits_ = true; }
  void EndIfQuit();

  const Clocks& clocks_;
  Surroundings& surroundings_;
  Options options_;
  int instances_ = 0;
  bool quits_ = false;
  std::unique_ptr<Process> process_;
};

}  // namespace calib::simulation
