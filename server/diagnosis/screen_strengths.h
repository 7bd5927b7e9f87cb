#pragma once
// How strong the screen tries an effect.

#include <string>

#include "dem/registry/catalog.h"

namespace calib::diagnosis {

/// The step on the ray that changes `share` of what a step of one changes, and the other way about;
/// both keep the sign (StrengthRay::order).
double StepFor(const dem::StrengthRay& ray, double share);
double ShareAt(const dem::StrengthRay& ray, double step);

/// How strong to try an effect of the catalogue whose first strength changes the histories by
/// `square` (see SquareOfDifference): so that it stands out from the chance in a difference of two
/// runs, which is the same however strong the effect is; from the catalogue's second strength to 16
/// times the first, within the default prior. In units of the ray.
double SecondStep(const dem::EffectInfo& effect, const dem::StrengthRay& ray, double square,
                  const std::string& contact, const dem::ReferenceState& state);

}  // namespace calib::diagnosis
