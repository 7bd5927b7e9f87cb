#include "dem/lab_tests/rotating_drum.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "dem/lab_tests/gravity_test.h"

namespace calib::dem {

GravityTestEntry RotatingDrum() {
  return {
      .info = {
          .name = "rotating_drum",
          .description =
              "Grains are poured into a horizontal drum (48 flat sides, "
              "periodic along its axis) and come to rest; the drum "
              "turns. Control: rotation_speed, each from the same filled drum. "
              "After a quarter turn the slope of the "
              "surface over the middle 60 % of its width is averaged over "
              "`turns`. Fails when the drum is too small for "
              "the grains, so fast that they stick to it (Froude number omega^2 R / g of 1 "
              "or more) or a grain escapes",
          .settings = WithCommonSettings(
              {Chosen("drum_diameter", "m",
                      "inner diameter; 0: so that the grains fill a third, or a quarter to a "
                      "seventh where "
                      "sizes differ much: they have to fit in loosely first"),
               Chosen("drum_length", "m", "of the periodic slice; 0: six largest grain diameters"),
               Setting("turns", "1", {.value = 0.25, .min = 0.01, .max = 1000},
                       "turns over which is averaged")}),
          .observables = {"rotation_speed", "angle_of_repose", "angle_fluctuation"},
          .control = "rotation_speed",
          .may_reverse = true,
          .reference = "Coetzee, Powder Technol. 310 (2017) 104, sec. 3 (drum test)",
          .poured = true,
          .separate_points = true,
          .control_range = ControlRange{.min = 0, .max = 1000}}};
}

std::string CentrifugeProblem(double speed, double diameter, double gravity) {
  const double froude = speed * speed * 0.5 * diameter / gravity;
  if (!(froude >= 1)) {
    return "";
  }
  return absl::StrCat("rotation_speed ", speed, " rad/s has a Froude number omega^2 R / g of ",
                      froude, " in a drum of ", diameter,
                      " m, which carries the grains around from 1 on: have it turn slower than ",
                      std::sqrt(2 * gravity / diameter), " rad/s");
}

}  // namespace calib::dem
