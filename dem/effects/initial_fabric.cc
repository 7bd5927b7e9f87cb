// `initial_fabric`: an anisotropic fabric left by the way the specimen was made.

#include "dem/model/effect.h"

namespace calib::dem {
namespace {

void Prepare(const ParameterSet& parameters, Preparation& preparation) {
  preparation.stress_anisotropy += parameters.Get("stress_anisotropy");
}

}  // namespace

/// Consolidation follows q/p = a, the `stress_anisotropy`,
///   sigma_a = p (1 + 2/3 a),   sigma_r = p (1 - a/3),
/// and ends at the stress asked for: contacts made under the larger stress remain. Positive: made
/// under axial load, as by pluviation or K0 compression; negative: in extension. Two-sided,
/// vanishes at 0. [Oda 1972; Yimsiri & Soga 2010, by preshearing]
EffectEntry InitialFabric() {
  ParameterInfo anisotropy;
  anisotropy.name = "stress_anisotropy";
  anisotropy.unit = std::string("1");
  anisotropy.min = -1.2;
  anisotropy.max = 1.5;
  anisotropy.default_prior = {.kind = "uniform", .min = -0.5, .max = 0.8};
  anisotropy.null_value = 0;
  anisotropy.description = "q/p during consolidation";
  return {.info = {.name = "initial_fabric",
                   .kind = "initial_state",
                   .description = "Consolidation at q/p = stress_anisotropy, then back to the "
                                  "stress asked for; two-sided, "
                                  "vanishes at stress_anisotropy 0",
                   .contacts = {},
                   .parameters = {anisotropy},
                   .reference =
                       "Oda, Soils Found. 12 (1972) 1; Yimsiri & Soga, Geotechnique 60 (2010) 699",
                   .two_sided = true,
                   .rays = {{.parameter = "stress_anisotropy", .steps = {0.2, 0.5}}}},
          .place = 140,
          .shows_in = &InPeriodicCell,
          .prepare = &Prepare};
}

}  // namespace calib::dem
