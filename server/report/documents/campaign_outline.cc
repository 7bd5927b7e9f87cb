#include "server/report/documents/campaign_outline.h"

#include <algorithm>
#include <map>
#include <optional>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "dem/registry/catalog.h"
#include "server/campaign/checks/in_words.h"
#include "server/campaign/checks/test_ties.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/methods/registry.h"
#include "server/report/text/people_units.h"
#include "server/report/text/text_table.h"

namespace calib::report {
namespace {

template <typename Entries>
absl::Status IsNamed(const Entries& entries, const std::string& name, const std::string& what) {
  std::vector<std::string> names;
  names.reserve(entries.size());
  for (const auto& entry : entries) names.push_back(entry.name);
  if (std::find(names.begin(), names.end(), name) != names.end()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("'", name, "' is no ", what, " of this build; ",
                                                 campaign::Suggestion(name, names)));
}

std::string WithUnit(double value, const std::string& unit) {
  return absl::StrCat(value, unit == "1" ? "" : " " + unit);
}

// A comment in front of what it is about.
std::string Comment(const std::string& text, const std::string& indent) {
  return Wrapped(text, indent + "# ", indent + "# ");
}

// A setting that only the user knows, as it is in small tests of grains.
std::string ValueToReplace(const std::string& unit) {
  static const std::map<std::string, std::string> kUsual = {
      {"Pa", "100 kPa"}, {"m", "1 mm"}, {"m/s", "1 m/s"}};
  const auto usual = kUsual.find(unit);
  return usual != kUsual.end() ? usual->second : WithUnit(1, unit);
}

std::string SettingsOf(const dem::TestInfo& test) {
  std::string text;
  for (const dem::ParameterInfo& setting : test.settings) {
    const bool drives = setting.name == test.control ||
                        std::find(test.other_controls.begin(), test.other_controls.end(),
                                  setting.name) != test.other_controls.end();
    if (drives && setting.name == test.control) continue;
    absl::StrAppend(&text, Comment(setting.description, "    "));
    if (setting.default_value) {
      absl::StrAppend(&text, "    # ", setting.name, ": ",
                      WithUnit(*setting.default_value, setting.unit), "\n");
    } else {
      absl::StrAppend(&text, "    ", setting.name, ": ", ValueToReplace(setting.unit),
                      "  # to be replaced: yours\n");
    }
  }
  return text;
}

std::map<std::string, double> DefaultsOf(const dem::TestInfo& test) {
  std::map<std::string, double> settings;
  for (const dem::ParameterInfo& setting : test.settings) {
    if (setting.default_value) settings[setting.name] = *setting.default_value;
  }
  return settings;
}

// What can be compared: one of each unit, the others in comments.
struct Compared {
  std::vector<std::string> taken, others;
};

Compared ComparedIn(const dem::TestInfo& test) {
  Compared compared;
  std::vector<std::string> units;
  for (const std::string& name : test.observables) {
    const std::string unit = dem::FindObservable(name)->unit;
    if (name == test.control || campaign::IsHeld(test.name, DefaultsOf(test), test.control, name)) {
      continue;
    }
    const bool is_new = std::find(units.begin(), units.end(), unit) == units.end();
    (is_new ? compared.taken : compared.others).push_back(name);
    units.push_back(unit);
  }
  return compared;
}

// Errors to begin with, of the size that instruments have.
std::string ErrorOf(const std::string& unit) {
  if (unit == "Pa") return "{relative: 0.02, floor: 1 kPa}";
  if (unit == "1") return "{absolute: 0.1 percent}";
  return "{relative: 0.05}";
}

std::string MeasurementsOf(const dem::TestInfo& test) {
  const Compared compared = ComparedIn(test);
  std::vector<std::string> columns = {test.control};
  columns.insert(columns.end(), compared.taken.begin(), compared.taken.end());
  std::vector<std::string> pairs, units;
  for (const std::string& name : columns) {
    pairs.push_back(absl::StrCat(name, ": ", name));
    units.push_back(absl::StrCat(name, ": ", dem::FindObservable(name)->unit));
  }
  std::string text = absl::StrCat(
      Comment("Your table: text, one row per reading. `calibctl inspect` says what is in it.",
              "    "),
      "    data:\n      file: data.csv\n", Comment("our name: column of the file", "      "),
      "      columns:\n");
  for (const std::string& pair : pairs) absl::StrAppend(&text, "        ", pair, "\n");
  absl::StrAppend(&text,
                  Comment("of the columns, e.g. percent, kPa; compression is positive", "      "),
                  "      units:\n");
  for (const std::string& unit : units) absl::StrAppend(&text, "        ", unit, "\n");
  absl::StrAppend(&text, "    control: ", test.control, "\n",
                  Comment("what is compared, each with the error of a reading", "    "),
                  "    observables:\n");
  for (const std::string& name : compared.taken) {
    absl::StrAppend(&text, "      ", name, ": {noise: ", ErrorOf(dem::FindObservable(name)->unit),
                    "}\n");
  }
  if (!compared.others.empty()) {
    absl::StrAppend(&text, Comment("also: " + absl::StrJoin(compared.others, ", "), "      "));
  }
  return text;
}

std::string SpecimenOf(const dem::TestInfo& test) {
  if (!test.needs_packing) return "";
  return absl::StrCat(
      Comment("or {file: packing.txt}; sizes by {mean, spread}, a grading curve or a log-normal",
              "    "),
      "    packing:\n      generate: {particles: 1000, ", test.poured ? "" : "porosity: 0.4, ",
      "radii: {mean: 1 mm, spread: 0.3}, seed: 1}\n",
      Comment("packings that the samples are spread over", "    "), "    realizations: 8\n");
}

std::string ParametersOf(const dem::ContactInfo& contact) {
  std::string text;
  for (const dem::ParameterInfo& parameter : contact.parameters) {
    const dem::DefaultPrior& prior = parameter.default_prior;
    const std::string unit = dem::UnitFor(parameter, contact.name);
    const bool other = !parameter.alternative_to.empty();
    absl::StrAppend(&text, Comment(parameter.description, "  "), other ? "  # " : "  ",
                    parameter.name, ": {prior: ", prior.kind, ", min: ", WithUnit(prior.min, unit),
                    ", max: ", WithUnit(prior.max, unit), "}",
                    other ? "  # in place of " + parameter.alternative_to : "", "\n");
  }
  return text;
}

}  // namespace

absl::StatusOr<std::string> CampaignOutline(const std::string& test_name,
                                            const std::string& contact_name) {
  RETURN_IF_ERROR(IsNamed(dem::Tests(), test_name, "test"));
  RETURN_IF_ERROR(IsNamed(dem::Contacts(), contact_name, "contact law"));
  const dem::TestInfo& test = *dem::FindTest(test_name);
  const dem::ContactInfo& contact = *dem::FindContact(contact_name);
  return absl::StrCat(
      Comment(
          "A campaign to begin with. Values are defaults to be confirmed; keys and their values: "
          "`calibctl schema`; is it right: `calibctl validate FILE`.",
          ""),
      "name: ", test.name, "\nmodel:\n", Comment(contact.description, "  "),
      "  contact: ", contact.name, "\n", Comment("added physics, of `calibctl effects`", "  "),
      "  # effects: [rolling_resistance]\n", "  density: 2650 kg/m^3\n",
      Comment("What is calibrated; what is known moves to model: {fixed: {NAME: value}}.", ""),
      "parameters:\n", ParametersOf(contact), "experiments:\n  - name: test1\n",
      Comment(test.description, "    "), "    test: ", test.name, "\n", SettingsOf(test),
      SpecimenOf(test), MeasurementsOf(test),
      Comment("an experiment that is not fitted, but judges the fit: validate", "    "),
      "    role: calibrate\n", "inference: {method: ", methods::All().standard()->name(),
      ", samples: 64}\n", "seed: 1\n");
}

}  // namespace calib::report
