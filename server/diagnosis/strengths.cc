#include "server/diagnosis/strengths.h"

#include <optional>

#include "absl/strings/str_cat.h"
#include "server/report/text/people_units.h"

namespace calib::diagnosis {

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

std::string WhyBeyondPrior(const std::map<std::string, dem::DefaultPrior>& priors,
                           const dem::EffectInfo& effect, const std::string& contact,
                           const std::map<std::string, double>& strength) {
  for (const dem::ParameterInfo& parameter : effect.parameters) {
    const std::string name = absl::StrCat(effect.name, ".", parameter.name);
    const auto found = strength.find(name);
    const auto prior = priors.find(name);
    if (found == strength.end() || prior == priors.end()) continue;
    const double value = found->second;
    // A value between the null and the prior's nearer end is a weaker effect, not a stronger one.
    const std::optional<double> null = dem::NullValueOf(parameter, contact);
    const bool below = value < prior->second.min && !(null && *null <= value);
    const bool above = value > prior->second.max && !(null && *null >= value);
    if (!below && !above) continue;
    const auto shown = [&](double number) {
      return report::NumberWithUnit(number, name, dem::UnitFor(parameter, contact), 3);
    };
    return absl::StrCat(name, " would have to be ", shown(value),
                        ", beyond the prior of an extension (", below ? "from " : "up to ",
                        shown(below ? prior->second.min : prior->second.max), ")");
  }
  return "";
}

}  // namespace calib::diagnosis
