#pragma once
// Specimens of elongated clumps from specimens of spheres, at the same density.

#include <stop_token>

#include "absl/status/statusor.h"
#include "dem/particles/packing.h"

namespace calib::dem {

/// Turns spheres into dumbbells of equal volume at constant cell: they grow from aspect 1 in steps
/// of at most 0.02, and after each the clumps, damped, give way to each other (friction 0.5).
/// Depends on packing and aspect only, never on the model, so that all samples of one aspect start
/// alike. Errors: CANCELLED on stop; OUT_OF_RANGE when grains are lost or the cell becomes too
/// short. Preconditions: single spheres; aspect in (1, 2].
absl::StatusOr<Packing> Elongate(const Packing& spheres, double aspect, int threads,
                                 std::stop_token stop);

}  // namespace calib::dem
