#pragma once
// What runs on different packings differ by, measured after the calibration on the best estimate or
// taken from the emulator of the runs.

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/emulator/emulated_posterior.h"
#include "inference/scatter/scatter.h"
#include "server/planning/definition.h"
#include "server/store/reader.h"

namespace calib::planning {

struct ObservableScatter {
  inference::GroupScatter group;  ///< indices of campaign.experiments and its observables
  const char* from = "";          ///< realizations | repeats | emulator
  int runs = 0;                   ///< it was found from
};

/// By what twin k moves every parameter, times k, in standardised coordinates: rounding makes
/// another run of it within some percent of strain (tests/verification/dem/twins_test.cc).
inline constexpr double kTwinShift = 1e-6;

/// campaign::ScatterShare, the largest of the calibrated experiments.
double LargestScatterShare(const campaign::Campaign& campaign);

struct MeasuredScatter {
  std::vector<ObservableScatter> observables{};
  /// R x T, departures of the replicates that came to an end on as many packings as every
  /// calibrated experiment with several has; of experiments with one packing zero. R is 0 or at
  /// least 2.
  Eigen::MatrixXd departures{};
};

/// Scatter of every observable of every experiment (held-out ones too) that has two or more
/// finished replicates on different packings, or where none are varied finished twins that have
/// parted (inference::HaveParted). Errors: those of the store.
absl::StatusOr<MeasuredScatter> MeasureScatter(const Definition& definition, std::int64_t campaign,
                                               store::Reader& reader);

/// Of every calibrated observable, from what the emulator does not explain of single runs.
std::vector<ObservableScatter> ScatterOfEmulator(const Definition& definition,
                                                 const inference::EmulatedResult& emulated);

/// The definition with scatter in the errors of its readings, where that changes the posterior:
/// filters with given noise. Other methods have decided by other errors.
Definition DefinitionWith(const Definition& definition, const MeasuredScatter& scatter);

}  // namespace calib::planning
