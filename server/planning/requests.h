#pragma once
// The evaluations that a sample needs: to be run, done before under the same digest, refused or
// taken from tables of runs made elsewhere. And the samples that held-out experiments are run for:
// those that carry the posterior.

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "absl/status/status.h"
#include "server/planning/definition.h"
#include "server/planning/plan.h"
#include "server/store/reader.h"

namespace calib::planning {

class Requests {
 public:
  /// Adds to `plan`. All must outlive it.
  Requests(const Definition& definition, std::int64_t campaign, store::Reader& reader, Plan& plan)
      : definition_(definition), id_(campaign), reader_(reader), plan_(plan) {}

  /// The calibrated experiments, up to their first rung where samples rest at rungs. refused: by
  /// the proposal, outside the prior; nothing is run. What was run before is reused where no run
  /// can rest or be stopped. Errors: those of the store.
  absl::Status Calibrate(const store::SampleRecord& sample, bool refused);
  /// These experiments to their ends, reusing what was run before. Errors: those of the store.
  absl::Status Run(const store::SampleRecord& sample, const std::vector<int>& experiments);

 private:
  absl::Status Request(const store::SampleRecord& sample, const std::vector<int>& experiments,
                       bool reuse);
  void TakeFromTables(const store::SampleRecord& sample);

  const Definition& definition_;
  std::int64_t id_;
  store::Reader& reader_;
  Plan& plan_;
};

/// Most samples that held-out experiments are run for.
inline constexpr std::size_t kHeldOutRuns = 20;

/// log_weights: normalised, of all samples. Positions of the samples with the largest weights
/// (ties: the earlier sample), no more than hold 99 % of the weight.
std::vector<std::size_t> Heaviest(const std::vector<double>& log_weights);

/// Positions, ascending, of the samples on which kHeldOutRuns evenly spaced shares of the weight
/// fall.
std::vector<std::size_t> EvenlyByWeight(const std::vector<double>& log_weights);

/// Rows of draws (n x d), evenly spaced in their order: `most` or kHeldOutRuns of them, or all.
Eigen::MatrixXd EvenlySpaced(const Eigen::MatrixXd& draws, std::size_t most);

}  // namespace calib::planning
