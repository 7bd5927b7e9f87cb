#pragma once
// How far the base model misses a measurement, by the emulator of its own runs: what effects do to
// runs of a design, and what an emulator misses of that, is no excuse for the model without them.

#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/diagnosis/knowledge.h"

namespace calib::diagnosis {

/// The best of the base model.
struct BaseMisfit {
  double chance = 1;               ///< of a right model to miss as much (ChanceOfMisfit)
  double square = 0, degrees = 1;  ///< of the misfit in the coordinates; its expectation
  double chance_of_square = 1;     ///< of a square as large
  double rms = 0;                  ///< of what is missed, in sd of a measurement
  /// The same by observable beyond the noise, in sd of that.
  std::map<std::string, double> missed{};
  double scatter = 0;  ///< of a single run, in sd of the noise of the coordinates
};

/// By runs of the base, and of the batches by what numerical choices change. rows: of the values of
/// the batches; without batches any of the base's axes. Errors: FAILED_PRECONDITION where the
/// model has no posterior; those of DiagnosisSet::Fit and AskEvidences.
absl::StatusOr<BaseMisfit> MisfitOfBase(const KnownBefore& before, const DesignRows& rows,
                                        const std::vector<EndedBatch>& batches);

/// Root mean square of a history (T, HistoryScale::Scaled), in sd of a measurement.
double RmsOf(const BaseRuns& base, const Eigen::RowVectorXd& history);

}  // namespace calib::diagnosis
