#pragma once
// How much the verdict on an effect owes to the width of the prior on its strength: an evidence
// falls as that prior widens (Lindley's paradox), so it is looked at for three widths.

#include <array>
#include <string>

#include "server/campaign/model/campaign.h"

namespace calib::diagnosis {

/// Factors on the distance from the null of everything that the prior of a strength allows.
constexpr std::array<double, 3> kStrengthScales = {0.25, 1, 4};

/// ln p(data) of a model with an effect, one for each of kStrengthScales, all on one emulator.
struct ScaledEvidence {
  std::array<double, 3> log_evidence{};
  double standard_error = 0;  ///< largest of the three, of the sampling alone
};

/// The campaign with the priors of the strengths of `effect` (parameters with a null that a ray of
/// the catalogue turns up or holds) widened: bounds and normal means at null + factor (x - null),
/// normal standard deviations times factor, cut to the admissible range. Log-normal priors move
/// with their median where the null is 0 and stay as they are elsewhere. factor > 0. Strengths that
/// are fixed stay.
campaign::Campaign WithStrengthScaled(const campaign::Campaign& campaign, const std::string& effect,
                                      double factor);

}  // namespace calib::diagnosis
