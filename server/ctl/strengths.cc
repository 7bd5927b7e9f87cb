#include "server/ctl/strengths.h"

#include "absl/strings/str_cat.h"
#include "server/report/people_units.h"

namespace calib::ctl {

std::map<std::string, std::string> UnitsOf(const dem::EffectInfo& effect,
                                           const std::string& contact) {
  std::map<std::string, std::string> units;
  for (const dem::ParameterInfo& parameter : effect.parameters) {
    units[absl::StrCat(effect.name, ".", parameter.name)] = dem::UnitFor(parameter, contact);
  }
  return units;
}

std::string WhyNotAdmissible(const dem::EffectInfo& effect, const std::string& contact,
                             const std::map<std::string, double>& strength) {
  for (const dem::ParameterInfo& parameter : effect.parameters) {
    const auto found = strength.find(absl::StrCat(effect.name, ".", parameter.name));
    if (found == strength.end()) continue;
    const double value = found->second;
    const bool low = parameter.min_open ? value <= parameter.min : value < parameter.min;
    if (!low && value <= parameter.max) continue;
    const auto shown = [&](double number) {
      return report::NumberWithUnit(number, found->first, dem::UnitFor(parameter, contact), 3);
    };
    return absl::StrCat(found->first, " would have to be ", shown(value),
                        ", not within its range (", low ? "from " : "up to ",
                        shown(low ? parameter.min : parameter.max), ")");
  }
  return "";
}

}  // namespace calib::ctl
