#include "dem/effects/shared/moment_stiffness.h"

#include <algorithm>
#include <optional>

#include "absl/strings/str_cat.h"
#include "dem/contact/materials.h"
#include "dem/contact/simd.h"

namespace calib::dem {
namespace {

MomentLaw LawOf(bool linear, double friction, std::optional<double> ratio,
                std::optional<double> stiffness) {
  MomentLaw law;
  law.limit_by_smaller = linear;
  // An infinite coefficient would make inf * 0 of an unloaded contact; the largest number does the
  // same and stays finite.
  law.friction = std::min(friction, 1e100);
  if (law.friction == 0) {
    return law;  // no stiffness either, so that the time step is that of the model without
  }
  if (ratio) {
    law.ratio = *ratio;
  } else {
    (linear ? law.ratio : law.constant) = stiffness.value();
  }
  return law;
}

CALIB_DEM_CLONES void EvaluateOfAll(const MomentLaw& law, const ContactBlock& b,
                                    MomentResponse& response) {
  double* const __restrict stiffness = response.stiffness;
  double* const __restrict limit = response.limit;
  const double constant = law.constant;
  const double ratio = law.ratio;
  const double friction = law.friction;
  for (int k = 0; k < kBlock; ++k) {
    stiffness[k] = constant + ratio * (b.radius_i[k] * b.radius_j[k] * b.tangential_stiffness[k]);
    const double mean = 0.5 * (b.radius_i[k] + b.radius_j[k]);
    limit[k] = friction * ((b.normal_force[k] > 0 ? b.normal_force[k] : 0.0) * mean);
  }
  if (law.limit_by_smaller) {
    for (int k = 0; k < kBlock; ++k) {
      const double smaller = b.radius_i[k] < b.radius_j[k] ? b.radius_i[k] : b.radius_j[k];
      limit[k] = friction * ((b.normal_force[k] > 0 ? b.normal_force[k] : 0.0) * smaller);
    }
  }
}

CALIB_DEM_CLONES void EvaluateOfPairs(const MomentLaw* laws, const ContactBlock& b,
                                      MomentResponse& response) {
  for (int k = 0; k < kBlock; ++k) {
    const MomentLaw& law = laws[b.materials[k]];
    response.stiffness[k] =
        law.constant + law.ratio * (b.radius_i[k] * b.radius_j[k] * b.tangential_stiffness[k]);
    const double mean = 0.5 * (b.radius_i[k] + b.radius_j[k]);
    const double smaller = b.radius_i[k] < b.radius_j[k] ? b.radius_i[k] : b.radius_j[k];
    const double load = b.normal_force[k] > 0 ? b.normal_force[k] : 0.0;
    response.limit[k] = law.friction * (load * (law.limit_by_smaller ? smaller : mean));
  }
}

}  // namespace

MomentLaw MomentLawFrom(const KernelContext& context) {
  return LawOf(context.linear_springs, context.parameters.Get("friction"),
               context.parameters.Find("stiffness_ratio"), context.parameters.Find("stiffness"));
}

std::vector<MomentLaw> MomentLawsFrom(const KernelContext& context) {
  if (context.materials == nullptr) {
    return {MomentLawFrom(context)};
  }
  const Materials& materials = *context.materials;
  std::vector<MomentLaw> laws;
  for (int a = 0; a < materials.count(); ++a) {
    for (int b = 0; b < materials.count(); ++b) {
      const auto said = [&](const char* parameter) {
        return materials.PairParameter(a, b, absl::StrCat(context.effect, ".", parameter));
      };
      const auto ratio = said("stiffness_ratio");
      const auto stiffness = said("stiffness");
      const bool own = ratio || stiffness;
      laws.push_back(LawOf(context.linear_springs,
                           said("friction").value_or(context.parameters.Get("friction")),
                           own ? ratio : context.parameters.Find("stiffness_ratio"),
                           own ? stiffness : context.parameters.Find("stiffness")));
    }
  }
  return laws;
}

void EvaluateMoment(const std::vector<MomentLaw>& laws, const ContactBlock& block,
                    MomentResponse& response) {
  if (block.mixed) {
    EvaluateOfPairs(laws.data(), block, response);
  } else {
    EvaluateOfAll(laws.front(), block, response);
  }
}

std::vector<ParameterInfo> MomentParameters(const std::string& motion) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  ParameterInfo stiffness;
  stiffness.name = "stiffness";
  stiffness.unit = "N m/rad";
  stiffness.unit_by_contact = {{"hertz_mindlin", "N m/rad"}, {"linear", "1"}};
  stiffness.max = 1e9;  // far above ks r^2 of rocks; infinite ones leave no time step
  stiffness.default_prior = {.kind = "uniform", .min = 0, .max = 1};
  stiffness.description =
      motion +
      " stiffness: the constant k_m [N m/rad] with hertz_mindlin (its effect "
      "depends on grain size), the factor in k_m = stiffness r1 r2 ks with linear";
  stiffness.null_value = 0;
  stiffness.scale_by_contact = {{"hertz_mindlin", {.pressure = 1, .diameter = 3}}};
  stiffness.scaled_prior = DefaultPrior{.kind = "log_uniform", .min = 0.01, .max = 100};
  ParameterInfo ratio;
  ratio.name = "stiffness_ratio";
  ratio.unit = "1";
  ratio.max = 1e6;
  ratio.default_prior = {.kind = "uniform", .min = 0, .max = 1};
  ratio.alternative_to = "stiffness";
  ratio.description = motion + " stiffness over r1 r2 ks with the current ks, for any contact law";
  ratio.null_value = 0;
  ParameterInfo friction;
  friction.name = "friction";
  friction.unit = "1";
  friction.max = kInfinity;
  friction.default_prior = {.kind = "uniform", .min = 0, .max = 1};
  friction.description = "limit eta of the " + motion +
                         " moment over Fn (r1+r2)/2 (hertz_mindlin) or Fn min(r1,r2) (linear); "
                         "infinite: no limit";
  friction.null_value = 0;
  stiffness.of_pairs = ratio.of_pairs = friction.of_pairs = true;
  return {stiffness, ratio, friction};
}

std::vector<StrengthRay> MomentRays() {
  return {{.parameter = "friction", .steps = {0.1, 0.3}, .held = {{"stiffness_ratio", 1}}},
          {.parameter = "stiffness_ratio", .steps = {0.1, 0.5}, .held = {{"friction", 0.3}}}};
}

}  // namespace calib::dem
