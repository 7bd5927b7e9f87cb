#include "server/ctl/catalog_text.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "server/report/text/people_units.h"
#include "server/report/text/text_table.h"

namespace calib::ctl {
namespace {

std::string Units(const dem::ParameterInfo& p) {
  if (p.unit_by_contact.empty()) return p.unit;
  std::string text;
  for (const auto& [contact, unit] : p.unit_by_contact) {
    absl::StrAppend(&text, text.empty() ? "" : ", ", unit, " (", contact, ")");
  }
  return text;
}

// A zero that is no value: the description says what the test chooses for it.
bool IsChosen(const dem::ParameterInfo& p) {
  return p.default_value == 0.0 && !p.whole && p.description.find("0: ") != std::string::npos &&
         p.description.find("spheres") == std::string::npos;  // of no thickness: is one
}

std::string DefaultOf(const dem::ParameterInfo& p) {
  if (IsChosen(p)) return "chosen";
  if (p.default_value) return report::Number(*p.default_value);
  return p.alternative_to.empty() ? "" : "instead of " + p.alternative_to;
}

std::string ScaledPrior(const dem::ParameterInfo& p) {
  if (!p.scaled_prior) return "";
  std::string scales = p.scale_by_contact.empty() ? ScaleText(p.scale) : "";
  for (const auto& [contact, scale] : p.scale_by_contact) {
    absl::StrAppend(&scales, scales.empty() ? "" : ", ", ScaleText(scale), " (", contact, ")");
  }
  return absl::StrCat("; scaled default prior ", p.scaled_prior->kind, " ",
                      report::Number(p.scaled_prior->min, 3), " .. ",
                      report::Number(p.scaled_prior->max, 3), " times ", scales);
}

constexpr const char* kIndent = "    ";

}  // namespace

std::string ScaleText(const dem::ReferenceScale& scale) {
  std::vector<std::string> factors;
  const auto add = [&factors](const char* name, double power) {
    if (power != 0) factors.push_back(power == 1 ? name : absl::StrCat(name, "^", power));
  };
  add("p", scale.pressure);
  add("d", scale.diameter);
  add("E", scale.modulus);
  if (scale.factor != 1 || factors.empty()) {
    factors.insert(factors.begin(), report::Number(scale.factor, 3));
  }
  return absl::StrJoin(factors, " ");
}

std::string EffectText(const dem::EffectInfo& effect) {
  std::string text = absl::StrCat(effect.name, " (", effect.kind, ")\n");
  text += report::Wrapped(effect.description, "  ", "  ") +
          report::Wrapped(effect.reference, "  ", "  ");
  if (!effect.contacts.empty()) {
    text += report::Wrapped(absl::StrJoin(effect.contacts, ", "), "  contacts: ", kIndent);
  }
  text += report::Wrapped(
      effect.excited_by.empty() ? "all tests" : absl::StrJoin(effect.excited_by, ", "),
      "  excited by: ", kIndent);
  if (effect.needs_motion) {
    text +=
        "  only where grains move while they are read: with a loading_rate, in collisions, in "
        "flows\n";
  }
  if (effect.needs_space)
    text += "  only where grains move in three dimensions: not with flat: 1\n";
  if (effect.across_pressures)
    text += "  only where the pressure differs, between experiments or within one\n";
  if (!effect.family.empty()) absl::StrAppend(&text, "  family: ", effect.family, "\n");
  if (!effect.excludes.empty()) {
    text += report::Wrapped(absl::StrJoin(effect.excludes, ", "), "  not together with: ", kIndent);
  }
  std::vector<std::string> of_pairs;
  for (const dem::ParameterInfo& p : effect.parameters) {
    if (p.of_pairs) of_pairs.push_back(absl::StrCat(effect.name, ".", p.name));
  }
  if (!of_pairs.empty()) {
    text += report::Wrapped(absl::StrJoin(of_pairs, ", "), "  of model.pairs too: ", kIndent);
  }
  return text + ParameterTable(effect.parameters);
}

std::string TestText(const dem::TestInfo& test) {
  std::string text = absl::StrCat(test.name, " (control: ", test.control,
                                  test.may_reverse ? "" : ", one way only", ")\n");
  text += report::Wrapped(test.description, "  ", "  ");
  if (!test.reference.empty()) text += report::Wrapped(test.reference, "  ", "  ");
  text += "  observables:\n";
  for (const std::string& name : test.observables) {
    const dem::ObservableInfo& info = *dem::FindObservable(name);
    text += report::Wrapped(absl::StrCat(name, " [", info.unit, "] ", info.description), kIndent,
                            "      ");
  }
  for (const dem::MeshInfo& mesh : test.meshes) {
    text +=
        report::Wrapped(absl::StrCat("mesh ", mesh.name, ": ", mesh.description), "  ", kIndent);
  }
  return text + ParameterTable(test.settings);
}

std::string ParameterTable(const std::vector<dem::ParameterInfo>& parameters) {
  report::TextTable table({"<  parameter", "<unit", "admissible", "<default prior", "<default"});
  for (const dem::ParameterInfo& p : parameters) {
    const auto shown = [&p](double value) {
      return report::NumberWithUnit(value, p.name, p.unit_by_contact.empty() ? p.unit : "1", 3);
    };
    table.AddRow(
        {"  " + p.name, Units(p), report::Number(p.min, 3) + " .. " + report::Number(p.max, 3),
         p.default_prior.kind.empty() ? ""
                                      : p.default_prior.kind + " " + shown(p.default_prior.min) +
                                            " .. " + shown(p.default_prior.max),
         DefaultOf(p)});
  }
  std::string text = table.ToString();
  for (const dem::ParameterInfo& p : parameters) {
    const std::string scaled = ScaledPrior(p);
    if (p.description.empty() && scaled.empty()) continue;
    text += report::Wrapped(absl::StrCat(p.name, ": ", p.description, scaled), kIndent, "      ");
  }
  return text;
}

}  // namespace calib::ctl
