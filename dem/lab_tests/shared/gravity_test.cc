#include "dem/lab_tests/shared/gravity_test.h"

#include "absl/strings/str_cat.h"

namespace calib::dem {

ParameterInfo Setting(const std::string& name, const std::string& unit, const SettingRange& range,
                      const std::string& description) {
  ParameterInfo info;
  info.name = name;
  info.unit = unit;
  info.min = range.min;
  info.max = range.max;
  info.default_value = range.value;
  info.default_prior = {.kind = "uniform", .min = range.min, .max = range.max};
  info.description = description;
  return info;
}

ParameterInfo Whole(const std::string& name, const SettingRange& range,
                    const std::string& description) {
  ParameterInfo info = Setting(name, "1", range, description);
  info.whole = true;
  return info;
}

ParameterInfo Chosen(const std::string& name, const std::string& unit,
                     const std::string& description) {
  return Setting(name, unit, {.value = 0, .min = 0, .max = 1000}, description);
}

ParameterInfo ThicknessOfDisks() {
  return Setting("thickness", "m", {.value = 0, .min = 0, .max = 10},
                 "of disks whose axes stand on the plane; 0: the grains are spheres");
}

double GivenSetting(const Scenario& scenario, const std::string& name, double otherwise) {
  const auto it = scenario.settings.find(name);
  return it != scenario.settings.end() && it->second > 0 ? it->second : otherwise;
}

std::string NarrowProblem(const Scenario& scenario, const Passage& passage) {
  const double given = GivenSetting(scenario, passage.setting);
  if (!(given > 0) || given > passage.least) {
    return "";
  }
  return absl::StrCat(passage.setting, " is ", given, " m, ", passage.grains, " ", passage.least,
                      " m: ", passage.why);
}

std::vector<ParameterInfo> WithCommonSettings(std::vector<ParameterInfo> own) {
  std::vector<ParameterInfo> all = {
      Setting("gravity", "m/s^2", {.value = kGravity, .min = 1e-3, .max = 1000},
              "acceleration of free fall, downwards along z"),
      Setting(
          "local_damping", "1", {.value = 0, .min = 0, .max = 0.9},
          "share of each grain's net force that opposes its motion (Cundall); also of its weight"),
      Setting("drag", "1/s", {.value = 0, .min = 0, .max = 1000},
              "global viscous damping: deceleration over velocity")};
  all.insert(all.end(), own.begin(), own.end());
  return all;
}

}  // namespace calib::dem
