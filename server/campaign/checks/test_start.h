#pragma once
// What is known of a test before it is run: where it begins, and what counts as there.

#include <cstddef>
#include <optional>
#include <vector>

#include "dem/model/readings.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// Part of the way of the control from the start within which the first reading counts as taken
/// there [-]. Chosen: stiffness of grains lets no stress rise by a quarter on it.
inline constexpr double kAtStart = 1e-3;
/// A strain that an observable begins with, over its range [-]. Chosen: as much as a reversal of
/// the control at most takes for noise (control_path.h).
inline constexpr double kSeatingStrain = 0.02;
/// sd of a reading that explain any difference [-].
inline constexpr double kErrors = 4;

/// Readings at the start of loading, of tests in the periodic cell: stresses are those of
/// consolidation, differences and strains zero, porosity that of the specimen (NaN: not known).
std::optional<dem::Measurement> KnownStartOf(const Experiment& experiment);

/// Porosity of the first specimen [-] before it is consolidated, or that it is consolidated to; NaN
/// where none is known.
double PorosityOfSpecimen(const Experiment& experiment);

/// The furthest that the control goes from its start.
double WayOf(const Experiment& experiment);

/// Largest size of the values that there are; 0: none.
double LargestSizeOf(const std::vector<double>& values);

/// Stated sd of a reading; 0 where none is.
double SdAt(const MeasuredObservable& observable, std::size_t at);

}  // namespace calib::campaign
