#include "dem/model/lab_test.h"

namespace calib::dem {

bool IsStressDriven(const TestInfo& test, const std::map<std::string, double>& settings) {
  const auto said = settings.find(kStressDriven);
  return test.stress_driven ||
         (!test.stress_control.empty() && said != settings.end() && said->second != 0);
}

std::string ControlOf(const TestInfo& test, const std::map<std::string, double>& settings) {
  if (!test.stress_control.empty() && IsStressDriven(test, settings)) {
    return test.stress_control;
  }
  if (test.other_controls.empty() || !settings.contains(test.control)) {
    return test.control;
  }
  for (const std::string& other : test.other_controls) {
    if (!settings.contains(other)) {
      return other;
    }
  }
  return test.other_controls.back();
}

}  // namespace calib::dem
