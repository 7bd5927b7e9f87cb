#pragma once
// An effect that a user writes as a formula in the campaign file, as data; dem/formula says what it
// may speak of and runs it.

#include <string>

#include "dem/model/effect.h"

namespace calib::dem {

/// What a formula does to its target.
enum class FormulaAction {
  kAdds,   ///< target + formula, in the target's unit; 0: no effect
  kScales  ///< target * formula, dimensionless; 1: no effect
};

/// A user's effect. info.kind says where it acts: "contact" between grains and at walls,
/// "measurement" on the readings.
struct UserEffect {
  EffectInfo info;  ///< name, parameters, rays, ... in the words of the effects of the build
  FormulaAction action = FormulaAction::kAdds;
  std::string target;   ///< a name of ContactTargets() or ReadingTargets()
  std::string formula;  ///< over the quantities of its kind and the effect's own parameters
};

}  // namespace calib::dem
