#include "dem/model/lab_test.h"

namespace calib::dem {

std::string ControlOf(const TestInfo& test, const std::map<std::string, double>& settings) {
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
