#include "dem/lab_tests/transfer_chute.h"

#include "dem/lab_tests/gravity_test.h"

namespace calib::dem {

GravityTestEntry TransferChute() {
  return {.info = {
              .name = "transfer_chute",
              .description = "Grains are fed onto a belt that throws them against a plate; "
                             "they fall through a funnel onto a ridge that "
                             "divides them to the left (y < 0) and the right. Control: "
                             "belt_speed. The funnel can be shifted along y and z "
                             "and turned about the belt's direction. Flows are those between "
                             "20 and 80 % of the grains that came through. "
                             "Fails when a grain escapes, when none meets the funnel or when "
                             "it blocks (fewer than half of the grains come through)",
              .settings = WithCommonSettings(
                  {Setting("funnel_angle", "rad", {.value = 0, .min = -0.5, .max = 0.5},
                           "of the funnel about the belt's direction"),
                   Setting("funnel_shift_y", "m", {.value = 0, .min = -100, .max = 100},
                           "of the funnel to the right"),
                   Setting("funnel_shift_z", "m", {.value = 0, .min = -100, .max = 100},
                           "of the funnel upwards"),
                   Setting("belt_friction", "1", {.value = 0.7, .min = 0, .max = 14},
                           "coefficient of friction on the belt"),
                   Chosen("feed_rate", "kg/s",
                          "onto the belt; 0: a layer that covers a third of the belt; at most 8 "
                          "grains of mean mass every 1.2 largest diameters of the belt")}),
              .observables = {"belt_speed", "mass_flow_left", "mass_flow_right",
                              "mass_flow_difference"},
              .control = "belt_speed",
              .may_reverse = true,
              .reference = "Samuelsson 2023, sec. 4.3",
              .poured = true,
              .separate_points = true,
              .control_range = ControlRange{.min = 0, .max = 100},
              .meshes = {{.name = "funnel",
                          .description =
                              "replaces the funnel (a solid, or a sheet that ends in two flat rims "
                              "and nowhere else), and the belt runs three largest grain "
                              "diameters above its highest point. Origin: the middle of the "
                              "lower opening, below which nothing reaches; x along the belt, "
                              "z upwards; the settings shift and turn it"}}}};
}

}  // namespace calib::dem
