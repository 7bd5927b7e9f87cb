#include "server/diagnosis/strength_scale.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "dem/registry/declared_effects.h"

namespace calib::diagnosis {
namespace {

// x at `factor` times its distance from the null, inside the admissible range. Infinite bounds and
// the open ends of log priors stay what they are.
double Moved(double x, double null, double factor, const dem::ParameterInfo& info) {
  if (!std::isfinite(x)) return x;
  return std::clamp(null + factor * (x - null), info.min, info.max);
}

inference::Prior Scaled(inference::Prior prior, double null, double factor,
                        const dem::ParameterInfo& info) {
  if (prior.kind == inference::PriorKind::kLogNormal) {
    if (null != 0) return prior;
    prior.mean += std::log(factor);
  } else if (prior.kind == inference::PriorKind::kNormal) {
    prior.mean = Moved(prior.mean, null, factor, info);
    prior.sd *= factor;
  }
  const inference::Prior before = prior;
  prior.min = Moved(prior.min, null, factor, info);
  prior.max = Moved(prior.max, null, factor, info);
  return prior.Validate().ok() ? prior : before;
}

}  // namespace

campaign::Campaign WithStrengthScaled(const campaign::Campaign& campaign, const std::string& effect,
                                      double factor) {
  campaign::Campaign scaled = campaign;
  const dem::EffectInfo* info = dem::FindEffect(campaign.model.user_effects, effect);
  if (info == nullptr) return scaled;
  for (const dem::ParameterInfo& parameter : info->parameters) {
    const bool strength =
        std::any_of(info->rays.begin(), info->rays.end(), [&](const dem::StrengthRay& ray) {
          return ray.parameter == parameter.name || ray.held.count(parameter.name) > 0;
        });
    const auto null = dem::NullValueOf(parameter, campaign.model.contact);
    if (!strength || !null) continue;
    const std::string name = absl::StrCat(effect, ".", parameter.name);
    for (campaign::CalibratedParameter& own : scaled.parameters) {
      if (own.name == name) own.prior = Scaled(own.prior, *null, factor, parameter);
    }
  }
  return scaled;
}

}  // namespace calib::diagnosis
