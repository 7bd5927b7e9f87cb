#pragma once
// Specimens made by the engine itself: of spheres here, of clumps by MakeClumps().

#include <stop_token>

#include "absl/status/statusor.h"
#include "dem/lab_tests/shared/shape_change.h"  // MakeClumps()
#include "dem/particles/packing.h"

namespace calib::dem {

/// Grains of the recipe's sizes, thrown loosely into a cell, for tests that pour them themselves;
/// the recipe's porosity and pressure are not used. Errors: those of GeneratePacking(), but
/// CANCELLED. Thread-safe.
absl::StatusOr<Packing> GenerateSizes(const PackingRecipe& recipe);

/// Generates a packing; the same recipe gives the same bits on every thread count. Independent of
/// the model's parameters, so that all samples of a campaign start from the same specimen. Errors:
/// OUT_OF_RANGE with the attainable porosity range when the target cannot be reached by lowering
/// friction; CANCELLED on stop. Thread-safe.
absl::StatusOr<Packing> GeneratePacking(const PackingRecipe& recipe, int threads,
                                        std::stop_token stop);

}  // namespace calib::dem
