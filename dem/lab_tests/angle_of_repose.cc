#include "dem/lab_tests/angle_of_repose.h"

#include "dem/lab_tests/gravity_test.h"

namespace calib::dem {

GravityTestEntry AngleOfRepose() {
  return {
      .info = {.name = "angle_of_repose",
               .description =
                   "Grains are poured into a cylinder on a level floor and come to rest; the "
                   "cylinder is lifted at "
                   "lift_speed and the heap comes to rest. Control: the number of the repetition, "
                   "each poured "
                   "anew. angle_of_repose is the slope of the line through the heap's surface "
                   "(mean of eight "
                   "sectors, rings of one diameter) between 15 and 85 % of its height, 0 where no "
                   "heap stands. "
                   "Fails when a grain escapes or overlaps a wall by more than half its radius",
               .settings = WithCommonSettings(
                   {Chosen("cylinder_diameter", "m",
                           "inner diameter; 0: as wide as the filling is high"),
                    Chosen("lift_speed", "m/s",
                           "of the cylinder; 0: 0.15 sqrt(gravity x mean diameter)")}),
               .observables = {"repetition", "angle_of_repose", "heap_height"},
               .control = "repetition",
               .may_reverse = true,
               .reference = "Coetzee, Powder Technol. 310 (2017) 104, sec. 3 (bulk calibration); "
                            "Samuelsson 2023, sec. 1",
               .poured = true,
               .separate_points = true,
               .control_range = ControlRange{.min = 0, .max = 1e6, .whole = true}}};
}

}  // namespace calib::dem
