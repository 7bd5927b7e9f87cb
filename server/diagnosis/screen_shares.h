#pragma once
// What a screen of effects runs, so that it costs no more than it may: which effects, in which
// experiments, how often.

#include <cstddef>
#include <string>
#include <vector>

#include "dem/registry/catalog.h"
#include "server/campaign/model/campaign.h"

namespace calib::diagnosis {

/// What a screen runs.
struct ScreenShares {
  std::size_t numerical = 0;  ///< numerical choices that are varied, in all fitted experiments
  int experiments = 0;        ///< that effects are run in
  std::vector<std::size_t> runs{};  ///< of each effect, 1 or 2, 0 where it is calculated
};

/// In a campaign of so many samples and fitted experiments, with a number of numerical choices to
/// vary, at most the larger of a quarter of the campaign's evaluations and four for each effect.
/// One run of each effect in as many experiments as that allows, at least one; a second goes first
/// to effects with another ray of strength, last to what instruments do. Numerical choices are
/// given up last.
ScreenShares SharesOfScreen(const std::vector<const dem::EffectInfo*>& effects,
                            const std::vector<bool>& calculated, std::size_t samples,
                            int experiments, std::size_t numerical);

/// The campaign with so many of its fitted experiments, all others held out: those that show most
/// effects together (WhyNotShown), of equals the first. What they miss is not asked.
campaign::Campaign ScreenedPart(const campaign::Campaign& campaign,
                                const std::vector<const dem::EffectInfo*>& effects,
                                int experiments);

}  // namespace calib::diagnosis
