#pragma once
// The threads of the service and what they own: the strand with the scheduler, the store, and pools
// for what takes moments (the status of a campaign), as long as it is large (lists, streams),
// seconds (campaigns are parsed, factorised, loaded) and minutes (plans). The gRPC reactors only
// move data between the wire and here. A queue of these threads holds one task of each call that is
// open, of which the door lets in so many.

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "server/scheduler/ports.h"
#include "server/scheduler/scheduler.h"
#include "server/service/door.h"
#include "server/service/guard.h"
#include "server/service/upkeep/metrics.h"
#include "server/service/upkeep/tidying.h"
#include "server/store/store.h"

namespace boost::asio {
class io_context;
}

namespace calib::service {

/// A worker's stream as the strand sees it. Called on the strand only; both calls return at once.
class Session {
 public:
  virtual ~Session() = default;
  virtual void Send(v1::ServerMessage message) = 0;
  /// Ends the stream after what was sent.
  virtual void Close(const absl::Status& status) = 0;
};

/// Post(), the pools, Read(), door() and guard() may be called on any thread; everything else as
/// said beside it.
class Core final : public scheduler::Ports {
 public:
  /// guard: who may call. on_failure is called once, on the strand, when the store can no longer be
  /// written.
  Core(std::unique_ptr<store::Store> store, std::unique_ptr<Guard> guard,
       scheduler::SchedulerOptions options, const Limits& limits,
       std::function<void(const absl::Status&)> on_failure);
  ~Core() override;

  /// Takes up what the store holds and starts the clock.
  absl::Status Start();
  /// Refuses what comes from now on and ends the streams. Reactors must be gone before the
  /// destructor.
  void BeginShutdown();

  /// Runs on the strand, in order. What a task asks to be written goes to the store at its end,
  /// together: a run's end and the next lease are one commit.
  void Post(std::function<void()> task);
  /// Runs on the pool for what takes moments.
  void Query(std::function<void()> task);
  /// Runs on the pool for answers that may be large: no status waits behind them.
  void Tell(std::function<void()> task);
  /// Runs on the pool for campaigns that are read, which may take seconds: no answer waits for it.
  void Parse(std::function<void()> task);
  /// Runs on a thread for what takes as long as the whole state is large, one after the other.
  void LookAfter(std::function<void()> task);
  /// Whether the server goes down.
  bool ends() const { return ends_; }
  Door& door() { return door_; }
  Guard& guard() { return *guard_; }

  // ---- on the strand only ----
  scheduler::Scheduler& scheduler() { return scheduler_; }
  Tidying& tidying() { return tidying_; }
  /// OK while the service takes work; UNAVAILABLE when it is going down; else why the store cannot
  /// be written.
  const absl::Status& health() const { return health_; }
  /// What the server waits for before it stores anything more, a sentence; empty: nothing.
  std::string WaitsFor() const;
  /// What is counted and measured, now.
  Measured Measure() const;
  /// Why no change is taken: health(), or RESOURCE_EXHAUSTED while the disk has no room; OK: it is.
  absl::Status WhyNotStore() const;
  /// Grows whenever something changed that a status shows.
  std::uint64_t version() const { return scheduler_.version() + changes_of_room_; }
  /// Grows whenever WaitsFor() changed.
  std::uint64_t changes_of_room() const { return changes_of_room_; }
  /// Write() of what nothing else depends on: RESOURCE_EXHAUSTED, in a sentence, where the disk has
  /// no room for it.
  void WriteIfRoom(store::Store::Job job, std::function<void(const absl::Status&)> then);
  std::int64_t AddSession(Session* session);
  void RemoveSession(std::int64_t session);
  boost::asio::io_context& strand();

  // ---- Ports ----
  void Write(store::Store::Job job, std::function<void(const absl::Status&)> then) override;
  absl::StatusOr<store::Reader> Read() override { return store_->Read(); }  // on any thread
  void Compute(std::function<std::function<void()>()> work) override;
  void Load(std::function<std::function<void()>()> work) override;
  void Later(std::function<void()> task) override { Post(std::move(task)); }
  void Send(std::int64_t session, v1::ServerMessage message) override;
  void Close(std::int64_t session, const absl::Status& status) override;
  /// Stands still while the disk has no room: workers that speak are not read then, and are not
  /// lost for it.
  std::chrono::steady_clock::time_point Now() override;
  std::int64_t UnixMs() override;

 private:
  void Fail(const absl::Status& status);
  /// On the strand: a task of it, then to the store what it has asked to be written.
  void Turn(const std::function<void()>& task);
  /// To the store, at the end of the Turn() that is running.
  void Ask(store::Store::Asked asked);
  /// What the store has said of a write that was asked for at `asked`, on the strand.
  void Written(absl::Status status, std::chrono::steady_clock::time_point asked,
               const std::function<void(const absl::Status&)>& then);
  /// To be called by the store: Written() on the strand.
  store::Store::Done TellsOf(std::function<void(const absl::Status&)> then);
  /// On the strand: writing waits for room, or goes on.
  void HearOfRoom(const absl::Status& room);
  /// As "0.3 MiB are free".
  std::string FreeSpace() const;
  void ScheduleTick();
  Tidying::Site TidyingSite();

  const scheduler::SchedulerOptions options_;
  const std::function<void(const absl::Status&)> on_failure_;
  const std::unique_ptr<Guard> guard_;
  Door door_;
  struct Threads;
  // Goes after the store, which posts to the strand to its end.
  const std::unique_ptr<Threads> threads_;
  std::unique_ptr<store::Store> store_;
  scheduler::Scheduler scheduler_;
  Tidying tidying_;
  std::chrono::steady_clock::time_point tidied_{};  // when it was begun last
  absl::Status health_;
  bool failed_ = false;
  std::atomic<bool> ends_ = false;
  struct Wait {
    std::string reason;
    std::chrono::steady_clock::time_point began{};
    std::int64_t began_unix_ms = 0;
  };
  std::optional<Wait> wait_;                       // the disk has no room
  std::chrono::steady_clock::duration waited_{0};  // of waits that are over
  std::uint64_t changes_of_room_ = 0;
  const std::chrono::steady_clock::time_point started_ = std::chrono::steady_clock::now();
  store::Durations strand_lag_, acknowledgements_;
  bool in_turn_ = false;
  std::vector<store::Store::Asked> asked_;  // in it, to be written
  std::map<std::int64_t, Session*> sessions_;
  std::int64_t last_session_ = 0;
  std::thread thread_;
};

}  // namespace calib::service
