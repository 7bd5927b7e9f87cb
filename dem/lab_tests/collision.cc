#include "dem/lab_tests/collision.h"

#include <limits>

namespace calib::dem {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

ParameterInfo Setting(const std::string& name, const std::string& unit,
                      const std::string& description) {
  ParameterInfo info;
  info.name = name;
  info.unit = unit;
  info.description = description;
  return info;
}

}  // namespace

TestInfo Collision() {
  ParameterInfo radius = Setting("radius", "m", "of the body that hits");
  radius.min_open = true;
  radius.max = 10;
  radius.default_prior = {.kind = "log_uniform", .min = 1e-4, .max = 1};
  ParameterInfo partner =
      Setting("partner_radius", "m",
              "of the body at rest, within a factor 10000 of radius; infinite: a wall");
  partner.min_open = true;
  partner.max = kInfinity;
  partner.default_prior = {.kind = "log_uniform", .min = 1e-4, .max = 1};
  partner.default_value = kInfinity;
  ParameterInfo thickness = Setting("thickness", "m", "of disks; 0: the bodies are spheres");
  thickness.max = 10;
  thickness.default_prior = {.kind = "uniform", .min = 0, .max = 1};
  thickness.default_value = 0;
  ParameterInfo angle = Setting("impact_angle", "rad", "to the normal, below 1.57");
  angle.max = 1.57;
  angle.default_prior = {.kind = "uniform", .min = 0, .max = 1.5};
  angle.default_value = 0;
  ParameterInfo speed = Setting("impact_speed", "m/s", "of the body that hits");
  speed.min_open = true;
  speed.max = 1e4;
  speed.default_prior = {.kind = "log_uniform", .min = 1e-3, .max = 1e2};
  ParameterInfo spin = Setting("impact_spin", "rad/s", "of the body, positive: adds to the slip");
  spin.min = -1e6;
  spin.max = 1e6;
  spin.default_prior = {.kind = "uniform", .min = -1e3, .max = 1e3};
  spin.default_value = 0;
  return {.name = "collision",
          .description =
              "A sphere (or disk) hits a wall or another at rest, without gravity: impact_angle, "
              "impact_speed or impact_spin driven through the control path, one collision each. "
              "Needs no packing. Fails when the bodies stick together, overlap by more than half "
              "the smaller radius, or gain energy though no user's formula acts",
          .settings = {radius, partner, thickness, angle, speed, spin},
          .observables = {"impact_angle", "impact_speed", "impact_spin", "normal_restitution",
                          "tangential_restitution", "energy_restitution", "rebound_angle",
                          "rebound_spin", "contact_duration", "peak_overlap"},
          .control = "impact_angle",
          .other_controls = {"impact_speed", "impact_spin"},
          .needs_packing = false,
          .may_reverse = true,
          .reference =
              "Hadjidoukas et al. 2014, sec. 4; Chung & Ooi, Granular Matter 13 (2011) "
              "643"};
}

std::string CollisionControl(const std::map<std::string, double>& settings) {
  for (const char* name : {"impact_angle", "impact_speed"}) {
    if (!settings.contains(name)) {
      return name;
    }
  }
  return "impact_spin";
}

}  // namespace calib::dem
