#pragma once
// A server program: the real scheduler over the real store, with what service::Core is beside
// threads and gRPC. Every queue of it goes on when it is told to.

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "calib/v1/campaign.pb.h"
#include "server/scheduler/ports.h"
#include "server/scheduler/scheduler.h"
#include "server/service/requests.h"
#include "server/service/upkeep/tidying.h"
#include "server/store/store.h"
#include "tests/simulation/dice.h"
#include "tests/simulation/wire.h"

namespace calib::simulation {

/// Who watches a server's words before they leave it, and what it takes in.
class Watcher {
 public:
  virtual ~Watcher() = default;
  virtual void Takes(const Stream& stream, const v1::WorkerMessage& message) = 0;
  virtual void Sends(const Stream& stream, const v1::ServerMessage& message) = 0;
  /// A write came to this.
  virtual void Wrote(const absl::Status& status) = 0;
  /// Something has been done on the strand; by the scheduler's clock alone.
  virtual void AfterTask(bool of_tick) = 0;
  /// How long a message is on its way.
  virtual milliseconds Delay() = 0;
};

/// Planted in what is around the scheduler.
struct PortFaults {
  bool acknowledges_early = false;  ///< a write is said to be on disk before it is
  bool reorders_writes = false;
};

/// Not thread-safe. The store's thread runs while this waits for it.
class ServerProcess final : public scheduler::Ports {
 public:
  ServerProcess(const Clocks& clocks, Dice& dice, Watcher& watcher, PortFaults faults)
      : clocks_(clocks), dice_(dice), watcher_(watcher), faults_(faults) {}
  ~ServerProcess() override;

  /// Opens the store and takes up what it holds; errors: the store's.
  absl::Status Start(const std::string& path, scheduler::SchedulerOptions options);
  /// What was asked to be written is written, as when the program ends in order.
  void WriteAll();

  // ---- what may go on ----
  std::size_t tasks() const { return strand_.size(); }
  void RunTask();
  std::size_t writes() const { return writes_.size(); }
  /// Of the next ones so many together, at most those that wait.
  void Commit(std::size_t most);
  /// Work aside that may begin now: two threads each.
  std::size_t plans() const { return std::min<std::size_t>(plans_.size(), 2); }
  std::size_t loads() const { return std::min<std::size_t>(loads_.size(), 2); }
  void Plan(std::size_t i) { Begin(plans_, i); }
  void Load(std::size_t i) { Begin(loads_, i); }
  /// What work aside has come to, not yet told.
  std::size_t results() const { return results_.size(); }
  void Tell(std::size_t i);
  bool ticks() const { return clocks_.now >= tick_; }
  void PostTick();
  Time next_tick() const { return tick_; }
  /// Pauses of what tidies.
  bool pauses_end() const { return !pauses_.empty(); }
  void EndPause();
  void Accept(const std::shared_ptr<Stream>& stream);
  bool MayRead(const Stream& stream) const;
  void ReadFrom(const std::shared_ptr<Stream>& stream);
  bool MayForget(const Stream& stream) const;
  void Forget(const std::shared_ptr<Stream>& stream);

  /// The store cannot be written any more.
  bool failed() const { return failed_; }
  int unreadable = 0;  ///< so many reads fail, as when no file can be opened

  // ---- what people ask, as service/campaigns_changes.cc has it ----
  using Answer = std::function<void(const absl::StatusOr<std::string>&)>;
  struct Wish {
    std::string verb{};
    std::int64_t campaign = 0;                   ///< but for submit
    int number = 0;                              ///< of priority, or slots of a quota (< 0: none)
    std::string owner{};                         ///< of submit and quota
    std::string key{};                           ///< of the request
    std::map<std::string, std::string> files{};  ///< of submit: path -> content
    std::string yaml{};
    planning::NewRuns runs{};  ///< of add_runs
  };
  void Ask(const Wish& wish, const Answer& answer);

  scheduler::Scheduler& scheduler() { return *scheduler_; }

  // ---- Ports ----
  void Write(store::Store::Job job, std::function<void(const absl::Status&)> then) override;
  absl::StatusOr<store::Reader> Read() override;
  void Compute(std::function<std::function<void()>()> work) override {
    plans_.push_back(std::move(work));
  }
  void Load(std::function<std::function<void()>()> work) override {
    loads_.push_back(std::move(work));
  }
  void Later(std::function<void()> task) override { strand_.push_back(std::move(task)); }
  void Send(std::int64_t session, v1::ServerMessage message) override;
  void Close(std::int64_t session, const absl::Status& status) override;
  Time Now() override { return clocks_.now; }
  std::int64_t UnixMs() override { return clocks_.unix_ms; }

 private:
  using Work = std::function<std::function<void()>()>;
  struct Waiting {
    store::Store::Job job;
    std::function<void(const absl::Status&)> then;
    bool waits_for_room = true;
  };
  void Begin(std::deque<Work>& queue, std::size_t i);
  std::vector<absl::Status> CommitTogether(std::vector<Waiting>& group);
  absl::Status Take(Stream& stream, const v1::WorkerMessage& message);
  void Submit(const Wish& wish, const Answer& answer);
  void Control(const Wish& wish, const Answer& answer);

  const Clocks& clocks_;
  Dice& dice_;
  Watcher& watcher_;
  const PortFaults faults_;
  std::unique_ptr<store::Store> store_;
  std::unique_ptr<scheduler::Scheduler> scheduler_;
  std::unique_ptr<service::Tidying> tidying_;
  service::Requests requests_;
  std::deque<std::function<void()>> strand_;
  std::deque<Waiting> writes_;
  std::deque<Work> plans_, loads_;
  std::vector<std::function<void()>> results_;
  std::deque<std::function<void()>> pauses_;
  std::map<std::int64_t, std::shared_ptr<Stream>> sessions_;
  std::int64_t last_session_ = 0;
  milliseconds lease_{};
  Time tick_{};
  bool of_tick_ = false;  // the task that runs
  bool failed_ = false;
};

}  // namespace calib::simulation
