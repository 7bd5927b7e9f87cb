#include "dem/lab_tests/shaken_box.h"

#include "dem/lab_tests/gravity_test.h"

namespace calib::dem {

GravityTestEntry ShakenBox() {
  return {
      .info = {
          .name = "shaken_box",
          .description =
              "One plane of grains (x and z only; spheres, or disks of a thickness) and one "
              "intruder in a box that moves by x = "
              "ax cos(w t), z = az sin(w t) and "
              "tilts by tilt sin(tilt_frequency t). Grains come to rest first, the intruder "
              "at intruder_start above the floor. "
              "Control: time. Heights are in the frame of the box. Fails when a grain escapes",
          .settings = WithCommonSettings(
              {ThicknessOfDisks(),
               Setting("intruder_ratio", "1", {.value = 2, .min = 1, .max = 20},
                       "diameter of the intruder over the largest grain's"),
               Chosen("intruder_start", "m",
                      "height of its centre before the others fall about it; 0: on the floor"),
               Chosen("box_width", "m", "0: 8.05 largest grain diameters"),
               Chosen("amplitude_x", "m", "ax; 0: 2.5 largest grain diameters"),
               Chosen("amplitude_z", "m", "az; 0: 4.15 largest grain diameters"),
               Chosen("frequency", "rad/s", "w; 0: 0.768 sqrt(gravity / largest grain diameter)"),
               Setting("tilt", "rad", {.value = 0.03490658503988659, .min = 0, .max = 0.5},
                       "amplitude of the tilt"),
               Chosen("tilt_frequency", "rad/s",
                      "of the tilt; 0: 8.13 sqrt(gravity / largest grain diameter)"),
               Chosen("height", "m",
                      "of fraction_above and exit_time; 0: five largest grain diameters")}),
          .observables = {"time", "intruder_height", "fraction_above", "exit_time"},
          .control = "time",
          .may_reverse = false,
          .reference = "Hadjidoukas et al. 2014, sec. 5.2, Eq. 16",
          .poured = true,
          .separate_points = false,
          .control_range = ControlRange{.min = 0, .max = 1e5}}};
}

}  // namespace calib::dem
