#pragma once
// All that a campaign has computed so far, as inference takes it.

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/filter/iterative_filter.h"
#include "server/planning/definition.h"
#include "server/store/reader.h"

namespace calib::planning {

struct History {
  /// Predictions of samples that did not finish are NaN. Draws from the posterior, on which
  /// held-out experiments are run (HeldOutDraws), are not part of any of this.
  std::vector<inference::Iteration> iterations;
  std::vector<std::string> proposals;  ///< JSON of each, as its method wrote it
  /// Rows of samples stopped early as far as they came, NaN beyond; other rows are NaN altogether.
  std::vector<Eigen::MatrixXd> stopped;
  std::vector<store::EvaluationKey> stopped_keys;  ///< evaluations stopped early or resting
  std::map<store::EvaluationKey, int> resting;     ///< those with a rung: they came no
                                                   ///< further than this load step
  std::set<store::EvaluationKey> begun;            ///< of those stopped early: they gave a state
  /// Samples on which a program failed as often as it may; their rows of `stopped` are as far as
  /// they came, and `iterations` has them set aside.
  std::set<int> unknown{};
  std::vector<std::vector<char>> diverged;   ///< [iteration][position]: it has no finite prediction
  std::vector<std::vector<char>> ended;      ///< likewise: nothing of it is waiting or running
  std::vector<store::SampleRecord> samples;  ///< of all iterations
  std::optional<std::string> last_posterior;      ///< JSON, of the last iteration that has one
  std::optional<std::string> previous_posterior;  ///< of the iteration before that
  int concluded = 0;      ///< iterations that have a posterior, the first ones
  int stopped_early = 0;  ///< samples; those rejected without a run are not among them
  std::int64_t open = 0;  ///< evaluations waiting or running
  store::Effort effort;
};

/// Stands in the place of an iteration's proposal when its samples are draws from the posterior,
/// made for held-out experiments alone.
inline constexpr const char* kHeldOutDraws = "\"draws from the posterior\"";
/// Likewise when they are the best estimate on every packing, one sample each.
inline constexpr const char* kReplicates = "\"best estimate on every packing\"";

/// Runs that a method learns from beside its own: the first of its first iteration. They were drawn
/// from no proposal and have no weight.
Eigen::Index GivenRuns(const campaign::Campaign& campaign);
/// Samples of an iteration at most, given runs among them: store::NewCampaign::samples.
int LargestIteration(const campaign::Campaign& campaign);

/// Reads every record in the order of its natural key; where batches stay as they are
/// (keeps_batches) the samples and states alone that definition.memory has not kept. iterations:
/// the first ones alone, as if nothing had followed (the core seconds are those of all); empty:
/// all.
absl::StatusOr<History> LoadHistory(const Definition& definition, std::int64_t campaign,
                                    store::Reader& reader, std::optional<int> iterations = {});

}  // namespace calib::planning
