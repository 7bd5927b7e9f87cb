// `strain_offset`: bedding and seating errors that close under load.

#include "dem/model/effect.h"

namespace calib::dem {
namespace {

void Alter(const ParameterSet& parameters, Apparatus& apparatus) {
  apparatus.seating += parameters.Get("offset");
  apparatus.seating_stress = parameters.Get("stress");
}

}  // namespace

///   reading of axial strain = eps + d0 (1 - exp(-x/q0)),   x >= 0 as in apparatus_compliance
/// Gaps between platens and specimen close as load comes on: strain that the specimen does not
/// have, most of it below q0. Drives the test like apparatus_compliance. One-sided, vanishes at
/// d0 = 0. [Jardine, Symes & Burland 1984; Goto et al. 1991]
EffectEntry StrainOffset() {
  ParameterInfo offset;
  offset.name = "offset";
  offset.unit = std::string("1");
  offset.max = 0.5;
  offset.default_prior = {.kind = "log_uniform", .min = 1e-4, .max = 0.1};
  offset.null_value = 0;
  offset.scale = {.factor = 0.01};
  offset.scaled_prior = DefaultPrior{.kind = "log_uniform", .min = 0.01, .max = 10};
  offset.description = "d0, strain read once all gaps have closed";
  ParameterInfo stress;
  stress.name = "stress";
  stress.unit = std::string("Pa");
  stress.max = 1e12;
  stress.min_open = true;
  stress.default_prior = {.kind = "log_uniform", .min = 1e3, .max = 1e7};
  stress.scale = {.pressure = 1};
  stress.scaled_prior = DefaultPrior{.kind = "log_uniform", .min = 0.01, .max = 10};
  stress.description = "q0, load that closes 63 % of the gaps";
  return {
      .info =
          {.name = "strain_offset",
           .kind = "measurement",
           .description = "Axial strain is read as eps + d0 (1 - exp(-x/q0)) and drives the test, "
                          "x = q (triaxial) or "
                          "sigma_a - sigma_a0 (oedometric), x > 0; one-sided, vanishes at offset 0",
           .contacts = {},
           .parameters = {offset, stress},
           .reference =
               "Jardine, Symes & Burland, Geotechnique 34 (1984) 323; Goto et al., Soils Found. 31 "
               "(1991) 169",
           .family = "strain_reading",
           .two_sided = false,
           .rays = {{.parameter = "offset", .steps = {0.1, 0.4}, .held = {{"stress", 0.3}}}}},
      .place = 170,
      .shows_in = [](const TestInfo& test) { return test.rig_load != RigLoad::kNone; },
      .alter = &Alter};
}

}  // namespace calib::dem
