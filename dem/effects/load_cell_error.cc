// `load_cell_error`: gain and zero of the load cell.

#include "dem/model/effect.h"

namespace calib::dem {
namespace {

void Alter(const ParameterSet& parameters, Apparatus& apparatus) {
  apparatus.load_gain += parameters.Get("gain");
  apparatus.load_offset += parameters.Get("offset");
}

}  // namespace

///   sigma_a reported = sigma_a + g x + s0,   x as in apparatus_compliance
/// The cell is taken to zero at the start of loading; what it then reads is wrong by a factor and
/// by a shift. Changes reports only, not the test. Two-sided, vanishes at g = 0 and s0 = 0.
/// [ASTM E74]
EffectEntry LoadCellError() {
  ParameterInfo gain;
  gain.name = "gain";
  gain.unit = std::string("1");
  gain.min = -0.9;
  gain.max = 10;
  gain.default_prior = {.kind = "uniform", .min = -0.3, .max = 0.3};
  gain.default_value = 0;
  gain.null_value = 0;
  gain.description = "g, relative error of the load since the start of loading";
  ParameterInfo offset;
  offset.name = "offset";
  offset.unit = std::string("Pa");
  offset.min = -1e10;
  offset.max = 1e10;
  offset.default_prior = {.kind = "uniform", .min = -1e5, .max = 1e5};
  offset.default_value = 0;
  offset.null_value = 0;
  offset.scale = {.pressure = 1};
  offset.scaled_prior = DefaultPrior{.kind = "uniform", .min = -0.3, .max = 0.3};
  offset.description = "s0, axial stress reported without load";
  return {.info = {.name = "load_cell_error",
                   .kind = "measurement",
                   .description = "Axial stress is reported as sigma_a + g x + s0, x = q "
                                  "(triaxial) or sigma_a - sigma_a0 "
                                  "(oedometric); two-sided, vanishes at gain 0 and offset 0",
                   .contacts = {},
                   .parameters = {gain, offset},
                   .reference =
                       "ASTM E74, calibration and verification for force-measuring instruments",
                   .two_sided = true,
                   .rays = {{.parameter = "gain", .steps = {0.05, 0.15}},
                            {.parameter = "offset", .steps = {0.03, 0.1}}}},
          .place = 190,
          .shows_in = [](const TestInfo& test) { return test.rig_load != RigLoad::kNone; },
          .alter = &Alter};
}

}  // namespace calib::dem
