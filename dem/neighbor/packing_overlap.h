#pragma once
// Grains of a packing that lie within each other.

#include <optional>

#include "dem/particles/packing.h"

namespace calib::dem {

/// How far grains of a packing lie within each other.
struct PackingOverlap {
  int first = 0, second = 0;  ///< the pair that overlaps most in smaller radii, first < second
  double overlap = 0;         ///< [m]
  int pairs = 0;              ///< number of pairs that overlap by more than half the smaller
                              ///< radius, this pair included
};

/// Pairs of grains, not of one clump, that overlap by more than half the smaller radius, from which
/// no run can start; empty: there is none. Takes time in proportion to the number of grains.
/// Precondition: the packing is as ParsePacking() leaves it when it finds nothing wrong.
std::optional<PackingOverlap> DeepOverlap(const Packing& packing);

}  // namespace calib::dem
