#include "dem/lab_tests/silo_discharge.h"

#include "dem/lab_tests/gravity_test.h"

namespace calib::dem {

GravityTestEntry SiloDischarge() {
  return {
      .info = {
          .name = "silo_discharge",
          .description =
              "Grains are poured into a silo with a level floor and come to rest; then an outlet "
              "opens in the middle. "
              "Control: the opening, each from the same filled silo. Where no grain leaves for "
              "jam_time while "
              "some stand above the outlet, an arch has formed: its lowest grain is taken out and "
              "set on top. "
              "Ends when the outlet has run empty, after `avalanches` arches or after `duration`. "
              "mass_flow_rate is the slope of the mass over the time of flow between 10 and 70 % "
              "of what left. An avalanche is what leaves until an arch forms, one or more grains; "
              "what leaves "
              "after the last arch belongs to none, and where no avalanche has ended "
              "(avalanche_count "
              "0) the sizes are all that left, a lower bound. "
              "Fails when a grain escapes",
          .settings = WithCommonSettings(
              {Whole("flat", {.value = 0, .min = 0, .max = 1},
                     "1: one plane of grains, x and z only, outlet a slot; 0: a cylinder, outlet "
                     "a circle"),
               ThicknessOfDisks(),
               Chosen("silo_width", "m",
                      "diameter, or width if flat; 0: twelve mean grain diameters, forty if flat"),
               Chosen("jam_time", "s",
                      "without a grain that tells an arch; 0: 20 sqrt(mean diameter / gravity)"),
               Whole("avalanches", {.value = 20, .min = 1, .max = 1e6},
                     "arches after which the test ends"),
               Chosen("duration", "s",
                      "longest time of discharge; 0: 400 sqrt(mean diameter / gravity)")}),
          .observables = {"opening", "mass_flow_rate", "discharged_mass", "avalanche_size", "jams",
                          "avalanche_count", "avalanche_median", "avalanche_p90"},
          .control = "opening",
          .may_reverse = true,
          .reference =
              "Hadjidoukas et al. 2014, sec. 5.3; Beverloo et al., Chem. Eng. Sci. 15 (1961) 260",
          .poured = true,
          .separate_points = true,
          .control_range = ControlRange{.min = 0, .max = 1000},
          .meshes = {{.name = "silo",
                      .description =
                          "replaces the cylinder (not with flat, nor with silo_width): a vessel "
                          "open at the top, whose cross-sections are such that every place within "
                          "sees wall along x and y in both directions, without holes in its "
                          "wall. Origin: the middle of the "
                          "outlet in the level floor, on which it stands; z upwards"}}}};
}

}  // namespace calib::dem
