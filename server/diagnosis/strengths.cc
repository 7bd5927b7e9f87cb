#include "server/diagnosis/strengths.h"

#include "absl/strings/str_cat.h"

namespace calib::diagnosis {

std::map<std::string, std::string> UnitsOf(const dem::EffectInfo& effect,
                                           const std::string& contact) {
  std::map<std::string, std::string> units;
  for (const dem::ParameterInfo& parameter : effect.parameters) {
    units[absl::StrCat(effect.name, ".", parameter.name)] = dem::UnitFor(parameter, contact);
  }
  return units;
}

}  // namespace calib::diagnosis
