// `wall_friction`: grains slide on walls with another friction than on each other.

#include "dem/model/effect.h"

namespace calib::dem {
namespace {

void Bound(const ParameterSet& parameters, WallProperties& walls) {
  walls.friction_ratio = parameters.Find("ratio").value_or(1.0);
  walls.friction = parameters.Find("coefficient");
}

}  // namespace

/// |Fs| <= tan(phi_w) Fn at contacts with walls, tan(phi_w) = ratio tan(phi_mu), or given as such.
/// Null: ratio 1. [Samuelsson 2023, sec. 4.1: particle-particle and particle-steel friction]
EffectEntry WallFriction() {
  ParameterInfo ratio;
  ratio.name = "ratio";
  ratio.unit = "1";
  ratio.min = 0;
  ratio.max = 10;
  ratio.default_prior = {.kind = "uniform", .min = 0, .max = 2};
  ratio.null_value = 1;
  ratio.description = "friction coefficient on walls over that between grains";
  ParameterInfo coefficient;
  coefficient.name = "coefficient";
  coefficient.unit = "1";
  coefficient.min = 0;
  coefficient.max = 14;
  coefficient.default_prior = {.kind = "uniform", .min = 0.1, .max = 1.0};
  coefficient.alternative_to = "ratio";
  coefficient.description = "coefficient tan(phi_w) of friction on walls";
  return {.info = {.name = "wall_friction",
                   .kind = "boundary",
                   .description =
                       "Friction of its own where a grain touches a wall: |Fs| <= tan(phi_w) Fn, "
                       "tan(phi_w) = ratio tan(phi_mu) or coefficient; two-sided, vanishes at "
                       "ratio 1. A wall counts as a partner of infinite radius",
                   .contacts = {},
                   .parameters = {ratio, coefficient},
                   .reference = "Samuelsson 2023, sec. 4.1, Table 4.1",
                   .two_sided = true,
                   .rays = {{.parameter = "ratio", .steps = {0.25, 0.5}}},
                   .one_material = "friction at walls of a material is that of the pair"},
          .place = 150,
          .shows_in = [](const TestInfo& test) { return test.has_walls; },
          .bound = &Bound};
}

}  // namespace calib::dem
