#pragma once
// Bounds of the campaign file that more than one of its readers holds to.

#include <cstdint>

#include "server/campaign/model/range.h"

namespace calib::campaign {

/// Shares that are neither nothing nor all.
inline constexpr Range kFraction{.min = 0, .max = 1, .min_open = true, .max_open = true};
/// Shares that may be all.
inline constexpr Range kShare{.min = 0, .max = 1, .min_open = true};
inline constexpr Range kNotNegative{.min = 0};

/// A packing of fewer is no specimen.
inline constexpr int kFewestGrains = 20;
inline constexpr int kMostGrains = 1'000'000;
/// Porosities and shapes of cells (height or depth over width) that packings are made with.
inline constexpr Range kRecipePorosity{.min = 0.2, .max = 0.6, .min_open = true, .max_open = true};
inline constexpr Range kRecipeAspect{.min = 0.2, .max = 5};
/// Of grains [m].
inline constexpr Range kGrainSize{.min = 0, .max = 10, .min_open = true};

inline constexpr int kMostThreadsOfRun = 1024;
inline constexpr std::int64_t kMostSamples = 1'000'000;

}  // namespace calib::campaign
