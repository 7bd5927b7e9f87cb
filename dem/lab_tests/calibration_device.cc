#include "dem/lab_tests/calibration_device.h"

#include "dem/lab_tests/gravity_test.h"

namespace calib::dem {

GravityTestEntry CalibrationDevice() {
  return {
      .info = {
          .name = "calibration_device",
          .description =
              "A slice, periodic along y: a hopper with walls at 60 degrees is filled "
              "above a trapdoor; the trapdoor opens, the "
              "material slides down a plate and piles up in a corner. Control: the "
              "number of the repetition, each poured "
              "anew. mass_flow_rate is the slope of the mass in the hopper between 90 "
              "and 10 % of it; slide_time the last "
              "time at which the slide bears at least 0.3 % of the material, or, where "
              "that never leaves it, the time of the "
              "end + 10 s x the share that stays, looked at 20 times per sqrt(mean "
              "diameter / gravity); angle_of_repose the slope at the "
              "inflexion of a sigmoid through the pile's "
              "surface. Fails when a grain escapes, when nothing piles up, or when the pile has "
              "grown to the slide's lower end, which it then buries",
          .settings = WithCommonSettings(
              {Chosen("opening", "m", "width of the outlet; 0: six mean grain diameters"),
               Setting("slide_angle", "rad", {.value = 0.7853981633974483, .min = 0.1, .max = 1.4},
                       "of the plate below the horizontal"),
               Chosen("slide_length", "m", "0: 16 mean grain diameters"),
               Chosen("slide_height", "m",
                      "of the slide's lower end above the floor; 0: ten mean grain diameters, or "
                      "more where a pile at 45 degrees of all grains, a solid fraction of 0.55 of "
                      "it, would stand higher"),
               Chosen("depth", "m", "of the periodic slice; 0: six largest grain diameters"),
               Chosen(
                   "duration", "s",
                   "longest time after opening; 0: 200 sqrt(mean diameter / gravity), or for large "
                   "fillings three times what they take through six mean grain diameters")}),
          .observables = {"repetition", "mass_flow_rate", "slide_time", "angle_of_repose"},
          .control = "repetition",
          .may_reverse = true,
          .reference = "Samuelsson 2023, sec. 4.1",
          .poured = true,
          .separate_points = true,
          .control_range = ControlRange{.min = 0, .max = 1e6, .whole = true},
          .meshes = {
              {.name = "slide",
               .description =
                   "replaces the plate (a solid, or a sheet without holes, its ends "
                   "straight across the slice). Origin: the middle of the plate's lower end as "
                   "slide_angle and slide_length place it, which place the hopper too; x "
                   "towards the hopper, z upwards, y across the slice, beyond both faces of "
                   "which it has to reach by a largest grain diameter"}}}};
}

}  // namespace calib::dem
