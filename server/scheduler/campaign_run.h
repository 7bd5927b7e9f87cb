#pragma once
// A live campaign in memory: which evaluations still need what, and how well the running iteration
// does so far. It mirrors the store; after a restart, and after a plan that resumes what had
// ended, it is read again from there. What a plan adds is read beside what is known.

#include <algorithm>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/data/gaussian_likelihood.h"
#include "server/campaign/model/sample_counts.h"
#include "server/planning/definition.h"
#include "server/planning/transitions.h"
#include "server/scheduler/leases/worker_table.h"
#include "server/store/reader.h"

namespace calib::scheduler {

using campaign::CampaignState;

/// How the running iteration does, from the load steps that every sample has reached.
struct LiveView {
  double effective_samples = 0;
  double best_misfit = 0;
};

/// Load steps of a path that are not yet there, a bit each: ten thousands of evaluations have some.
/// Not thread-safe.
class MissingSteps {
 public:
  MissingSteps() = default;
  explicit MissingSteps(std::size_t steps) : missing_(steps, true), count_(steps) {}
  /// By position in the path.
  void Erase(std::size_t position) {
    count_ -= missing_[position] ? 1 : 0;
    missing_[position] = false;
  }
  /// Whether any up to this position, itself included, is missing.
  bool AnyUpTo(std::size_t position) const {
    return std::find(missing_.begin(), missing_.begin() + static_cast<std::ptrdiff_t>(position) + 1,
                     true) != missing_.begin() + static_cast<std::ptrdiff_t>(position) + 1;
  }
  std::size_t size() const { return count_; }
  bool empty() const { return count_ == 0; }

 private:
  std::vector<bool> missing_;
  std::size_t count_ = 0;
};

/// The DEM of this build, as WorkerTable::Mechanics. Thread-safe.
const std::string& OwnMechanics();

/// Not thread-safe.
class CampaignRun {
 public:
  struct Evaluation {
    store::EvaluationStatus status = store::EvaluationStatus::kWaiting;
    int failures = 0;  ///< see store::EvaluationRecord, as the next
    int losses = 0;
    MissingSteps missing{};
    std::optional<int> rest_after{};
    std::string held_in{};  ///< see store::EvaluationRecord
    std::string digest{};
  };

  static absl::StatusOr<std::unique_ptr<CampaignRun>> Load(const campaign::MethodList& methods,
                                                           store::Reader& reader, std::int64_t id);
  /// Reads samples, evaluations and states again. Progress is kept: memory may be ahead of the disk
  /// in it.
  absl::Status Reload(store::Reader& reader);
  /// The same campaign without samples, evaluations and states: to be reloaded on any thread, and
  /// given back to Fill().
  std::unique_ptr<CampaignRun> Unfilled() const;
  void Fill(CampaignRun&& reloaded);
  /// What the store has beyond memory.
  struct More {
    struct State {
      store::EvaluationKey key{};
      int load_step = 0;
      std::vector<double> observables{};
    };
    std::vector<store::SampleRecord> samples{};
    std::vector<store::EvaluationRecord> evaluations{};
    std::vector<State> states{};  ///< of those that came with some
  };
  /// Reads that, on any thread, beyond what memory has now.
  std::function<absl::StatusOr<More>(store::Reader&)> LookForMore() const;
  /// Takes in what is new of it, and leaves the others as memory has them.
  void Take(const More& more);

  std::int64_t id() const { return id_; }
  const planning::Definition& definition() const { return *definition_; }
  std::shared_ptr<const planning::Definition> shared_definition() const { return definition_; }
  const store::CampaignRecord& record() const { return record_; }
  store::CampaignProgress& progress() { return record_.progress; }
  void SetPriority(int priority) { record_.priority = priority; }
  CampaignState state() const { return state_; }
  /// FAILED_PRECONDITION when the event is not allowed now; else changes state() and progress().
  absl::Status Apply(planning::CampaignEvent event, const std::string& reason);

  Evaluation* Find(const store::EvaluationKey& key);
  /// Keys with this status, in order.
  std::vector<store::EvaluationKey> With(store::EvaluationStatus status) const;
  std::size_t Count(store::EvaluationStatus status) const;
  /// Of one sample, in order.
  std::vector<store::EvaluationKey> OfSample(int sample) const;
  /// Those that wait and have this digest, which is not empty.
  std::vector<store::EvaluationKey> WaitingFor(const std::string& digest) const;
  /// What a program failed on as often as it may, of samples that no posterior has taken in yet.
  std::vector<store::EvaluationKey> UnknownOfRunningIteration() const;
  bool AllTerminal() const;
  /// Whether a plan may have something to say: everything has ended, or the campaign decides while
  /// runs are under way (decisions.h) and something has ended that no plan has seen.
  bool WantsPlan() const;
  /// What is open and was planned by a program with other mechanics, with its digest by this one.
  std::map<store::EvaluationKey, std::string> OfOtherMechanics() const;
  /// Anything has ended or given a state.
  bool HasBegun() const;
  /// Reads again what the store has of these evaluations: statuses and states.
  absl::Status Refresh(store::Reader& reader, const std::vector<store::EvaluationKey>& keys);
  /// Forgets what has been computed of it; it waits.
  void BeginAnew(const store::EvaluationKey& key, const std::string& digest);
  /// A plan is made of what is known now. again: and one more after it, whatever it says.
  void Planned(bool again);
  const campaign::RunOf& RunOfSample(int sample) const { return samples_.at(sample); }

  /// Load steps of an experiment's path.
  std::size_t PathLength(int experiment) const {
    return positions_.at(static_cast<std::size_t>(experiment)).size();
  }
  /// Whether a worker that may run these programs (Hello::programs) may run the campaign's.
  template <typename Names>
  bool MayBeRunBy(const Names& programs) const {
    const auto& program = definition_->campaign.program;
    return !program || std::any_of(programs.begin(), programs.end(), [&](const auto& name) {
      return name == "*" || name == program->command.front();
    });
  }
  /// Slots that a run holds of such a worker, the fewest whose threads and memory are together what
  /// it needs; 0: it has not as many, may not run the campaign's program, has another DEM than the
  /// server (runs of programs need none), or would not hold a run to its limits.
  int SlotsOf(const WorkerTable::Kind& kind) const;
  /// Whether its runs are of the DEM and have limits of their own.
  bool NeedsLimits() const;
  /// Everything wrong with a state that a worker sent, in a sentence; empty: acceptable.
  std::string Refusal(const store::EvaluationKey& key, int load_step,
                      std::span<const double> observables) const;
  /// True when every load step up to the one where it rests (or the end) is there.
  bool HasArrived(const store::EvaluationKey& key) const;
  void AddState(const store::EvaluationKey& key, int load_step,
                std::span<const double> observables);
  void SetStatus(const store::EvaluationKey& key, store::EvaluationStatus status, int failures);

  /// Experiments of a sample that may be stopped run one after the other, in the order of the file:
  /// the bound of each has what those before it came to, whatever arrives first.
  bool IsItsTurn(const store::EvaluationKey& key) const;
  /// True when an evaluation has shown, by its states so far and by the experiments before it, that
  /// its sample cannot count (early_stopping.h).
  bool ShouldStop(const store::EvaluationKey& key) const;
  /// Calibrated experiments of the same sample that wait: what is stopped with it.
  std::vector<store::EvaluationKey> WaitingBeside(const store::EvaluationKey& key) const;
  /// Another threshold for that, see store::SampleRecord.
  void SetStopBelow(int sample, double stop_below) { stop_below_[sample] = stop_below; }

  /// Samples of the running iteration.
  const campaign::SampleCounts& Counts();
  /// Samples of the running iteration of which an evaluation diverged or is unknown, and those with
  /// nothing left to run; where points are chosen one by one the last that have ended, as many as
  /// its first iteration has.
  int Diverged() const;
  int Done() const;

  /// How the running iteration did when that was last computed; nothing at first.
  const LiveView& view() const { return view_; }
  void SetView(const LiveView& view) { view_ = view; }
  /// Whether something has happened since Look() was last called.
  bool ViewIsOld() const { return looked_at_ != changes_; }
  /// Computes the view of what is known now, on any thread: with errors that go together it may
  /// take seconds.
  std::function<LiveView()> Look();

 private:
  CampaignRun(std::int64_t id, std::shared_ptr<const planning::Definition> definition);
  void FactoriseErrors();
  /// Compares digests, which takes tens of microseconds each: once, where the campaign is read.
  void FindOtherMechanics();
  /// Readings of a sample of the running iteration, or of one before it that had not ended.
  struct Arrived {
    Eigen::RowVectorXd predictions;  ///< NaN where they have not
    bool out = false;                ///< diverged or stopped
  };
  using ArrivedBySample = std::map<int, Arrived>;
  /// Samples and evaluations that are new; which evaluations these are.
  std::set<store::EvaluationKey> Take(const std::vector<store::SampleRecord>& samples,
                                      const std::vector<store::EvaluationRecord>& evaluations);
  /// Of the samples from `first` to `last`.
  absl::Status AddStates(store::Reader& reader, int first, int last);
  void AddState(const store::EvaluationKey& key, int load_step, std::span<const double> observables,
                Evaluation& evaluation, Arrived* arrived);
  bool IsOfRunningIteration(int sample) const;
  campaign::SampleStatus StatusOf(int sample) const;
  bool IsCalibrated(int experiment) const;
  /// Those that have not ended.
  std::vector<store::EvaluationKey> Open() const;
  std::set<int> OpenSamples() const;
  std::set<int> EndedForPause() const;
  /// Results that a plan could go by: how many have ended, in their order up to the first that has
  /// not where the campaign decides reproducibly.
  std::size_t Results() const;

  std::int64_t id_;
  std::shared_ptr<const planning::Definition> definition_;
  store::CampaignRecord record_;
  CampaignState state_ = CampaignState::kQueued;
  /// Of running evaluations; empty with ess_target.
  std::optional<inference::GaussianLikelihood> likelihood_;
  std::map<store::EvaluationKey, Evaluation> evaluations_;
  std::map<store::EvaluationStatus, std::set<store::EvaluationKey>> by_status_;
  std::multimap<std::string, store::EvaluationKey> by_digest_;  // where there is one
  /// Planned by a program with other mechanics and not over when they were read, with their digests
  /// by this one.
  std::map<store::EvaluationKey, std::string> of_other_mechanics_;
  std::map<int, campaign::RunOf> samples_;  // by number
  std::map<int, double> stop_below_;        // samples that may be stopped early
  ArrivedBySample arrived_;
  std::optional<std::size_t> planned_;                 // Results() when a plan was made last
  std::vector<std::map<int, std::size_t>> positions_;  // in the path, by experiment and load step
  campaign::SampleCounts counts_;
  std::optional<int> counted_;  // iteration that they are of; nothing: they are to be counted
  LiveView view_;
  std::uint64_t changes_ = 1;  // of what the view is of
  std::uint64_t looked_at_ = 0;
};

}  // namespace calib::scheduler
