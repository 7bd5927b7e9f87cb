#include "server/ctl/catalog_text.h"

#include "server/ctl/text_table.h"
#include "server/report/people_units.h"

namespace calib::ctl {
namespace {

std::string Units(const dem::ParameterInfo& p) {
  if (p.unit_by_contact.empty()) return p.unit;
  std::string text;
  for (const auto& [contact, unit] : p.unit_by_contact) {
    text += (text.empty() ? "" : ", ") + unit + " (" + contact + ")";
  }
  return text;
}

}  // namespace

std::string ParameterTable(const std::vector<dem::ParameterInfo>& parameters) {
  TextTable table({"<  parameter", "<unit", "admissible", "<default prior", "<default"});
  for (const dem::ParameterInfo& p : parameters) {
    const auto shown = [&p](double value) {
      return report::NumberWithUnit(value, p.name, p.unit_by_contact.empty() ? p.unit : "1", 3);
    };
    table.AddRow(
        {"  " + p.name, Units(p), report::Number(p.min, 3) + " .. " + report::Number(p.max, 3),
         p.default_prior.kind.empty() ? ""
                                      : p.default_prior.kind + " " + shown(p.default_prior.min) +
                                            " .. " + shown(p.default_prior.max),
         p.default_value ? report::Number(*p.default_value)
                         : (p.alternative_to.empty() ? "" : "instead of " + p.alternative_to)});
  }
  return table.ToString();
}

}  // namespace calib::ctl
