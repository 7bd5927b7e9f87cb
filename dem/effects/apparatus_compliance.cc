// `apparatus_compliance`: the loading frame shortens too.

#include "dem/model/effect.h"

namespace calib::dem {
namespace {

void Alter(const ParameterSet& parameters, Apparatus& apparatus) {
  apparatus.compliance += parameters.Get("compliance");
}

}  // namespace

///   reading of axial strain = eps + x/K
/// x is the load on the frame since the start of loading: q in triaxial tests, sigma_a - sigma_a0
/// in oedometric ones. The reading drives the test: a stage ends when it, not the specimen's
/// strain, has reached the control. In oedometric tests volume follows the reading, in triaxial
/// ones it is measured apart. One-sided, vanishes at compliance 1/K = 0.
/// [Jardine, Symes & Burland 1984]
EffectEntry ApparatusCompliance() {
  ParameterInfo compliance;
  compliance.name = "compliance";
  compliance.unit = std::string("1/Pa");
  compliance.max = 1;
  compliance.default_prior = {.kind = "log_uniform", .min = 1e-11, .max = 1e-6};
  compliance.null_value = 0;
  compliance.scale = {.factor = 0.01, .pressure = -1};  // a strain of 1 % at a load of p
  compliance.scaled_prior = DefaultPrior{.kind = "log_uniform", .min = 0.01, .max = 10};
  compliance.description = "1/K, axial strain read per load on the frame";
  return {.info = {.name = "apparatus_compliance",
                   .kind = "measurement",
                   .description = "Axial strain is read as eps + x/K and drives the test, x = q "
                                  "(triaxial) or sigma_a - "
                                  "sigma_a0 (oedometric); one-sided, vanishes at compliance 0",
                   .contacts = {},
                   .parameters = {compliance},
                   .reference = "Jardine, Symes & Burland, Geotechnique 34 (1984) 323",
                   .family = "strain_reading",
                   .two_sided = false,
                   .rays = {{.parameter = "compliance", .steps = {0.1, 0.5}}}},
          .place = 160,
          .shows_in = [](const TestInfo& test) { return test.rig_load != RigLoad::kNone; },
          .alter = &Alter};
}

}  // namespace calib::dem
