#pragma once
// What runs on different packings differ by, measured after the calibration on the best estimate or
// taken from the emulator of the runs.

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/emulator/emulated_posterior.h"
#include "inference/scatter/scatter.h"
#include "server/scheduler/definition.h"
#include "server/store/reader.h"

namespace calib::scheduler {

struct ObservableScatter {
  inference::GroupScatter group;  ///< indices of campaign.experiments and its observables
  const char* from = "";          ///< realizations | repeats | emulator
  int runs = 0;                   ///< it was found from
};

/// Whether an experiment has two packings. Where none has, replicates are repeats on the one there
/// is: every parameter is moved by some kRepeatShift, which rounding makes another run of within
/// some percent of strain.
bool VariesPackings(const campaign::Campaign& campaign);
inline constexpr double kRepeatShift = 1e-6;  ///< in standardised coordinates, times the repeat

/// How often the best estimate is to be run: as the campaign says, else once for each of the most
/// realizations of an experiment, up to 16, and not at all where no experiment has two; 0 where
/// runs are given and where errors are not (ess_target).
int ReplicatesOf(const campaign::Campaign& campaign);

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
/// finished replicates on different packings, or where none are varied finished repeats. Errors:
/// those of the store.
absl::StatusOr<MeasuredScatter> MeasureScatter(const Definition& definition, std::int64_t campaign,
                                               store::Reader& reader);

/// Of every calibrated observable, from what the emulator does not explain of single runs.
std::vector<ObservableScatter> ScatterOfEmulator(const Definition& definition,
                                                 const inference::EmulatedResult& emulated);

/// The definition with scatter in the errors of its readings, where that changes the posterior:
/// filters with given noise. tmcmc and surrogate_msrs have decided by other errors.
Definition DefinitionWith(const Definition& definition, const MeasuredScatter& scatter);

}  // namespace calib::scheduler
