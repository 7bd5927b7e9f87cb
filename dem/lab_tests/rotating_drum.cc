#include "dem/lab_tests/rotating_drum.h"

#include "dem/lab_tests/gravity_test.h"

namespace calib::dem {

GravityTestEntry RotatingDrum() {
  return {.info = {.name = "rotating_drum",
                   .description = "Grains are poured into a horizontal drum (48 flat sides, "
                                  "periodic along its axis) and come to rest; the drum "
                                  "turns. Control: rotation_speed, each from the same filled drum. "
                                  "After a quarter turn the slope of the "
                                  "surface over the middle 60 % of its width is averaged over "
                                  "`turns`. Fails when the drum is too small for "
                                  "the grains or a grain escapes",
                   .settings = WithCommonSettings(
                       {Chosen("drum_diameter", "m",
                               "inner diameter; 0: so that the grains fill about a third"),
                        Chosen("drum_length", "m",
                               "of the periodic slice; 0: six largest grain diameters"),
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

}  // namespace calib::dem
