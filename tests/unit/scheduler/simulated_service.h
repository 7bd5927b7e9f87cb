#pragma once
// The scheduler with everything around it simulated: time, threads, streams and workers. Only the
// store is real.

#include <gtest/gtest.h>

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "server/methods/registry.h"
#include "server/scheduler/scheduler.h"
#include "tests/support/client.h"
#include "tests/support/small_campaign.h"

namespace calib::scheduler {

/// What a test knows to be there, by value.
template <typename T>
T Value(absl::StatusOr<T> result) {
  return *std::move(result);
}

/// Runs continuations when it is told to, in the order in which they were asked for.
class SimulatedPorts final : public Ports {
 public:
  explicit SimulatedPorts(store::Store& store) : store_(store) {}

  /// Until nothing is left to be done.
  void Run();
  /// The first thing that is to be done, if there is any.
  void RunOne();

  void Write(store::Store::Job job, std::function<void(const absl::Status&)> then) override;
  absl::StatusOr<store::Reader> Read() override;
  void Compute(std::function<std::function<void()>()> work) override;
  void Load(std::function<std::function<void()>()> work) override { Compute(std::move(work)); }
  void Later(std::function<void()> task) override { tasks_.push_back(std::move(task)); }
  void Send(std::int64_t session, v1::ServerMessage message) override;
  void Close(std::int64_t session, const absl::Status& status) override;
  std::chrono::steady_clock::time_point Now() override { return now; }
  std::int64_t UnixMs() override { return 1000; }

  std::chrono::steady_clock::time_point now{};
  std::map<std::int64_t, std::deque<v1::ServerMessage>> inbox;  ///< by session
  std::vector<std::int64_t> closed;
  int unreadable = 0;  ///< so many reads fail, as when no file can be opened
  int refused = 0;     ///< writes whose rows the store has refused

 private:
  store::Store& store_;
  std::deque<std::function<void()>> tasks_;
};

/// Campaigns that the simulated server takes at a time.
inline constexpr int kMostCampaigns = 12;

/// A store in a fresh file, a scheduler over it and as many workers as wanted; the model is a
/// closed formula, so that a whole campaign takes milliseconds.
class SimulatedService {
 public:
  explicit SimulatedService(const std::string& name,
                            const campaign::MethodList& methods = methods::All());

  /// A new server process on the same file: memory is gone, streams are cut.
  void Restart();
  /// The same, up to where it begins to read its campaigns.
  void BeginRestart();
  /// Of a build that has these methods.
  void RestartWith(const campaign::MethodList& methods) {
    methods_ = &methods;
    Restart();
  }
  std::string Submit(const testing::SmallCampaign& campaign,
                     const std::function<void()>& answered = {});
  absl::StatusOr<bool> AddRuns(const planning::NewRuns& runs);
  std::int64_t Connect(const std::string& worker, int slots,
                       const std::vector<std::int64_t>& held = {});
  /// The next message of this kind for a session, others skipped; an empty message when there is
  /// none.
  v1::ServerMessage Next(std::int64_t session, v1::ServerMessage::MessageCase kind);
  v1::StateBatch States(const v1::Lease& lease, int first, int count) const;
  void SendStates(std::int64_t session, const v1::Lease& lease, int first, int count);
  void SendEnd(std::int64_t session, std::int64_t attempt, v1::Finished::Outcome outcome,
               const std::string& reason = "");
  void Advance(std::chrono::milliseconds time);
  /// Time goes by without a tick of the server's.
  void StandStill(std::chrono::milliseconds time);
  /// Lets workers run, die, fall silent and come back at random until the campaign is over; the
  /// server is restarted now and then. calm: nothing goes wrong, one worker.
  void RunToEnd(unsigned seed, bool calm);

  /// Memory counts the samples as the store has them.
  void CompareCounts();

  /// One worker of one slot each, calm, in simulated time: evaluation k of the campaign takes
  /// seconds(k), its states come evenly spread over that. Until the campaign is over.
  struct Shift {
    double elapsed = 0;    ///< s
    double computing = 0;  ///< s, of all workers
  };
  Shift RunTimed(int workers, const std::function<double(int)>& seconds);

  store::CampaignRecord Campaign();
  /// What the store holds about the campaign's result, with every bit.
  std::string Fingerprint();
  /// The same of any campaign, without proposals and posteriors, which tell of effort too.
  std::string Runs(std::int64_t campaign);

  /// Relative change of a curve from one packing to another, a number of order one times this.
  double packing_scatter = 0;
  /// The same between parameters that differ in digits that nobody knows, from -1 to 1 times this.
  double repeat_scatter = 0;
  /// That every run is said to have taken.
  double core_seconds = 0;
  /// Runs that fail in RunToEnd() after their first states, as a program does; none.
  std::function<bool(const v1::AttemptSpec&)> fails;
  /// Who submits.
  std::string owner{};
  /// What workers that connect say besides.
  std::function<void(v1::Hello&)> dress{};
  /// Load steps that workers of RunToEnd() had to compute: without those of a checkpoint.
  int computed = 0;

  SimulatedPorts& ports() { return *ports_; }
  Scheduler& scheduler() { return *scheduler_; }
  store::Reader Read() { return *store_->Read(); }
  void Write(const store::Store::Job& job) { EXPECT_TRUE(store_->WriteNow(job).ok()); }

 private:
  struct Busy {
    v1::Lease lease;
    int sent = 0;
  };
  struct Simulated {
    std::int64_t session = 0;
    std::map<std::int64_t, Busy> busy;
    std::map<std::string, int> resting;  // load steps behind it, by run
  };
  void Absorb(Simulated& worker);
  void Step(Simulated& worker, std::mt19937& random);

  const campaign::MethodList* methods_;
  const std::string path_;
  std::unique_ptr<store::Store> store_;
  std::unique_ptr<SimulatedPorts> ports_;
  std::unique_ptr<Scheduler> scheduler_;
  std::int64_t last_session_ = 0;
};

/// The samples of campaign 1 of which a run has come to its end.
std::vector<store::SampleRecord> SamplesRun(SimulatedService& service);

/// The posterior of the last iteration of campaign 1 that has one.
v1::Posterior LastPosterior(SimulatedService& service);

}  // namespace calib::scheduler
