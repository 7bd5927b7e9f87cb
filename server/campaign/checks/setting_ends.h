#pragma once
// Calibrated settings against what their tests can be, at the ends of their priors.

#include <string>
#include <vector>

#include "server/campaign/model/campaign.h"

namespace calib::campaign {

struct ImpossibleEnd {
  std::string parameter;
  std::string problem;  ///< a sentence: which test, at which value, and what is wrong with it there
};

/// What the engine would refuse of an experiment where a calibrated setting of it stands at an end
/// of its prior (one in 1000 where there is none) and all else in the middle: the first problem of
/// each setting. And settings that are the control of an experiment with more than one reading.
/// Call when nothing is wrong in the middle.
std::vector<ImpossibleEnd> ImpossibleEnds(const Campaign& campaign);

}  // namespace calib::campaign
