// `membrane_stiffness`: a rubber membrane that confines a bulging specimen.

#include "dem/model/effect.h"

namespace calib::dem {
namespace {

void Alter(const ParameterSet& parameters, Apparatus& apparatus) {
  apparatus.membrane += parameters.Get("stiffness");
}

}  // namespace

///   sigma_r of the specimen = sigma_cell + M max(0, -eps_r)
/// The lateral stress held on the specimen grows as it bulges, while the laboratory reports the
/// cell pressure; M = 2 E_m t/D of a membrane of modulus E_m and thickness t on a diameter D.
/// Triaxial tests only. One-sided, vanishes at M = 0. [Henkel & Gilbert 1952]
EffectEntry MembraneStiffness() {
  ParameterInfo stiffness;
  stiffness.name = "stiffness";
  stiffness.unit = std::string("Pa");
  stiffness.max = 1e12;
  stiffness.default_prior = {.kind = "log_uniform", .min = 1e3, .max = 1e8};
  stiffness.null_value = 0;
  stiffness.scale = {.pressure = 1};
  stiffness.scaled_prior = DefaultPrior{.kind = "log_uniform", .min = 0.01, .max = 10};
  stiffness.description = "M, lateral stress per lateral extension";
  return {.info = {.name = "membrane_stiffness",
                   .kind = "measurement",
                   .description = "Lateral stress on the specimen is the reported cell pressure + "
                                  "M max(0, -eps_r); one-sided, "
                                  "vanishes at stiffness 0",
                   .contacts = {},
                   .parameters = {stiffness},
                   .reference = "Henkel & Gilbert, Geotechnique 3 (1952) 20",
                   .two_sided = false,
                   .rays = {{.parameter = "stiffness", .steps = {0.5, 2}}}},
          .place = 180,
          .shows_in = [](const TestInfo& test) { return test.rig_load == RigLoad::kDeviatoric; },
          .alter = &Alter};
}

}  // namespace calib::dem
