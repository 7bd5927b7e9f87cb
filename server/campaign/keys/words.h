#pragma once
// Words of the campaign file that only its reader knows.

#include <array>

#include "inference/prior/prior.h"
#include "server/campaign/model/word_table.h"

namespace calib::campaign {

inline constexpr std::array kPriorWords = {
    Word{inference::PriorKind::kUniform, "uniform"},
    Word{inference::PriorKind::kLogUniform, "log_uniform"},
    Word{inference::PriorKind::kNormal, "normal"},
    Word{inference::PriorKind::kLogNormal, "log_normal"},
};

/// What the prior of an error's size is of.
enum class ErrorScaleOf { kSd, kVariance };
inline constexpr std::array kErrorScaleWords = {
    Word{ErrorScaleOf::kSd, "sd"},
    Word{ErrorScaleOf::kVariance, "variance"},
};

/// How the laboratory computed its strains.
enum class Strain { kEngineering, kLogarithmic };
inline constexpr std::array kStrainWords = {
    Word{Strain::kEngineering, "engineering"},
    Word{Strain::kLogarithmic, "logarithmic"},
};

/// On which side of its null value a strength may be.
enum class Sign { kPlus, kMinus, kEither };
inline constexpr std::array kSignWords = {
    Word{Sign::kPlus, "positive"},
    Word{Sign::kMinus, "negative"},
    Word{Sign::kEither, "either"},
};

}  // namespace calib::campaign
