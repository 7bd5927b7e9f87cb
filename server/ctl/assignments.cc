#include "server/ctl/assignments.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "dem/registry/catalog.h"
#include "dem/registry/model_parameters.h"
#include "server/campaign/file/text/quantity.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/model/range.h"

namespace calib::ctl {
namespace {

using campaign::Quoted;

std::vector<std::string> KnownNames(const campaign::Campaign& campaign) {
  std::vector<std::string> names;
  names.reserve(campaign.parameters.size());
  for (const campaign::CalibratedParameter& parameter : campaign.parameters) {
    names.push_back(parameter.name);
  }
  for (const auto& [name, value] : campaign.model.parameters) names.push_back(name);
  return names;
}

// Of a program's parameter: what it is measured in is all that is known of it.
std::string ApplyToProgram(const std::string& name, const std::string& text,
                           const campaign::Campaign& campaign,
                           std::map<std::string, double>& values) {
  for (const campaign::CalibratedParameter& parameter : campaign.parameters) {
    if (parameter.name != name) continue;
    if (values.contains(name)) return absl::StrCat("--set ", name, " is given twice");
    const auto value = campaign::ParseQuantity(text, parameter.unit);
    if (!value.ok()) {
      return absl::StrCat("--set ", name, ": ", std::string(value.status().message()));
    }
    values[name] = *value;
    return "";
  }
  return absl::StrCat("--set ", name, ": the campaign has no such parameter; ",
                      campaign::Suggestion(name, KnownNames(campaign)));
}

// What is wrong with one assignment, or nothing.
std::string Apply(const std::string& assignment, const campaign::Campaign& campaign,
                  std::map<std::string, double>& values) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string::npos || equals == 0) {
    return absl::StrCat("--set ", Quoted(assignment),
                        " is not NAME=VALUE, e.g. --set young_modulus='2 GPa'");
  }
  const std::string name = assignment.substr(0, equals);
  if (const campaign::TiedParameter* tied = campaign::FindTied(campaign, name)) {
    return absl::StrCat("--set ", name, ": follows from ", absl::StrJoin(tied->inputs, ", "),
                        " (equal_to: ", tied->text, "), and has no value of its own");
  }
  if (campaign.program) {
    return ApplyToProgram(name, assignment.substr(equals + 1), campaign, values);
  }
  const auto calibrated = std::find_if(
      campaign.parameters.begin(), campaign.parameters.end(),
      [&name](const campaign::CalibratedParameter& parameter) { return parameter.name == name; });
  const bool of_population = calibrated != campaign.parameters.end() && calibrated->of_population;
  const bool is_setting =
      calibrated != campaign.parameters.end() && (calibrated->setting || of_population);
  const dem::ParameterInfo* info = dem::FindParameter(campaign.model, name);
  if (info == nullptr && !is_setting) {
    return absl::StrCat("--set ", name, ": the model has no such parameter; ",
                        campaign::Suggestion(name, KnownNames(campaign)));
  }
  if (values.contains(name)) return absl::StrCat("--set ", name, " is given twice");
  const std::string& unit =
      is_setting ? calibrated->unit : dem::UnitFor(*info, campaign.model.contact);
  const auto value = campaign::ParseQuantity(assignment.substr(equals + 1), unit);
  if (!value.ok()) return absl::StrCat("--set ", name, ": ", std::string(value.status().message()));
  const campaign::Range range = of_population ? campaign::Range{.min = calibrated->prior.min}
                                : is_setting  ? calibrated->setting->range
                                              : campaign::AdmissibleRange(*info);
  if (!range.Contains(*value)) {
    return absl::StrCat("--set ", name, ": ", Quoted(assignment.substr(equals + 1)),
                        " is outside what is allowed: ", range.Describe(unit));
  }
  values[name] = *value;
  return "";
}

}  // namespace

absl::StatusOr<std::vector<double>> ApplyAssignments(const std::vector<std::string>& assignments,
                                                     campaign::Campaign& campaign) {
  std::vector<std::string> problems;
  std::map<std::string, double> values;
  std::set<std::string> refused;  // named with a value that cannot be: no second problem
  for (const std::string& assignment : assignments) {
    if (std::string problem = Apply(assignment, campaign, values); !problem.empty()) {
      problems.push_back(problem);
      refused.insert(assignment.substr(0, assignment.find('=')));
    }
  }
  std::vector<double> calibrated;
  for (const campaign::CalibratedParameter& parameter : campaign.parameters) {
    const auto value = values.find(parameter.name);
    if (value == values.end()) {
      if (refused.contains(parameter.name)) continue;
      if (parameter.of_population) {  // as in a sample whose labels all have the common value
        calibrated.push_back(0);
        continue;
      }
      if (campaign.program) {  // a dry run does with any
        calibrated.push_back(parameter.prior.Quantile(0.5));
        continue;
      }
      problems.push_back(absl::StrCat(
          parameter.name, " is calibrated in this campaign and needs a value: --set ",
          parameter.name, "=VALUE", parameter.unit == "1" ? "" : "[ " + parameter.unit + "]"));
      continue;
    }
    calibrated.push_back(value->second);
    values.erase(value);
  }
  if (!problems.empty()) return absl::InvalidArgumentError(absl::StrJoin(problems, "\n"));
  for (const auto& [name, value] : values) campaign.model.parameters[name] = value;
  return calibrated;
}

}  // namespace calib::ctl
