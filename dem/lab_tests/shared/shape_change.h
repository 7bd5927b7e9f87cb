#pragma once
// Specimens of clumps from specimens of spheres, at the same density.

#include <cstdint>
#include <stop_token>

#include "absl/status/statusor.h"
#include "dem/particles/clump_template.h"
#include "dem/particles/packing.h"

namespace calib::dem {

/// Turns spheres into dumbbells of equal volume, length over width `aspect`, at constant cell: they
/// grow from aspect 1 in steps of at most 0.02, and after each the clumps, damped, give way to each
/// other (friction 0.5). Depends on packing and aspect only, never on the model, so that all
/// samples of one aspect start alike. Errors: CANCELLED on stop; OUT_OF_RANGE when grains are lost
/// or the cell becomes too short. Preconditions: single spheres; aspect in (1, 2].
absl::StatusOr<Packing> Elongate(const Packing& spheres, double aspect, int threads,
                                 std::stop_token stop);

/// A packing in which every sphere has become a clump of its volume.
struct ClumpPacking {
  Packing packing;             ///< clump ids are the indices of the spheres
  double porosity = 0;         ///< 1 - volumes of the unions over the cell
  double largest_overlap = 0;  ///< of two clumps that touch, in radii of the smaller sphere
};

/// Turns spheres into clumps of a shape of equal volume at constant cell, in orientations drawn
/// from the seed: spheres grow into the shape (Between) by at most 0.02 radii at a time, without
/// friction, so that long ones find room. Materials stay with their grains. Errors:
/// INVALID_ARGUMENT when a grain is part of a clump already, two overlap by more than half a
/// radius, or the cell is not longer than two clumps; CANCELLED on stop; OUT_OF_RANGE when grains
/// are lost or the cell becomes too short.
absl::StatusOr<ClumpPacking> MakeClumps(const Packing& spheres, const ClumpTemplate& shape,
                                        std::uint64_t seed, int threads, std::stop_token stop);

}  // namespace calib::dem
