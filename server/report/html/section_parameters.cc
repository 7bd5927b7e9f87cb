#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "server/report/html/sections.h"
#include "server/report/text/html.h"

namespace calib::report {
namespace {

// Where the 5-95 % interval lies within the prior's range.
std::string RangeBar(const v1::Posterior::Parameter& p, bool log) {
  const auto fraction = [&p, log](double value) {
    const double f = log && p.prior_min() > 0
                         ? std::log(value / p.prior_min()) / std::log(p.prior_max() / p.prior_min())
                         : (value - p.prior_min()) / (p.prior_max() - p.prior_min());
    return std::clamp(f, 0.0, 1.0);
  };
  constexpr double kWidth = 100;
  if (std::isnan(p.q05())) return "–";
  const double left = kWidth * fraction(p.q05());
  const double width = std::max(1.5, kWidth * fraction(p.q95()) - left);
  return fmt::format(
      "<svg viewBox=\"0 0 {0} 14\" width=\"{0}\" height=\"14\" role=\"img\"><title>{1}: 5 to 95 % "
      "of the posterior within the "
      "prior's range</title><rect class=\"rangebar\" x=\"0\" y=\"4\" width=\"{0}\" height=\"6\" "
      "rx=\"3\"/><rect "
      "class=\"rangepart\" x=\"{2:.2f}\" y=\"4\" width=\"{3:.2f}\" height=\"6\" rx=\"2\"/><rect "
      "class=\"rangemean\" "
      "x=\"{4:.2f}\" y=\"1\" width=\"2\" height=\"12\"/></svg>",
      kWidth, Escape(NameForPeople(p.name())), left, width, kWidth * fraction(p.mean()) - 1);
}

bool HasLogPrior(const campaign::Campaign& campaign, const std::string& name) {
  return std::any_of(campaign.parameters.begin(), campaign.parameters.end(),
                     [&name](const auto& parameter) {
                       return parameter.name == name &&
                              (parameter.prior.kind == inference::PriorKind::kLogUniform ||
                               parameter.prior.kind == inference::PriorKind::kLogNormal);
                     });
}

// How far the means of two halves of the runs lie apart, in sd of the posterior.
std::string HalvesCell(const v1::Posterior::Parameter& p) {
  return fmt::format("<td>{}</td>",
                     std::isfinite(p.split_half()) ? Number(p.split_half(), 2) : "–");
}

std::string Row(const v1::Posterior::Parameter& p, bool log, bool halves) {
  const DisplayUnit unit = ParameterUnit(p);
  const auto shown = [&unit](double value, int digits) {
    return Escape(Number(value * unit.factor, digits));
  };
  return fmt::format(
      "<tr><td>{}{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</"
      "td>"
      "{}<td>{} – {}</td><td class=\"l\">{}</td><td class=\"l{}\">{}</td></tr>\n",
      Escape(NameForPeople(p.name())), unit.label.empty() ? "" : ", " + Escape(unit.label),
      shown(p.mean(), 4), shown(p.sd(), 2), Percent(p.cov(), 2), shown(p.q05(), 3),
      shown(p.q50(), 3), shown(p.q95(), 3), halves ? HalvesCell(p) : "", shown(p.prior_min(), 3),
      shown(p.prior_max(), 3), RangeBar(p, log), p.at_bound() ? " bad" : "",
      p.at_bound() ? "at a bound" : "");
}

}  // namespace

std::string ParameterSection(const ReportData& data) {
  const auto& parameters = data.view.posterior.parameters();
  const bool halves = std::any_of(parameters.begin(), parameters.end(),
                                  [](const auto& p) { return std::isfinite(p.split_half()); });
  std::string html = fmt::format(
      "<h2>Identified parameters</h2>\n<div class=\"scroll\"><table>\n<tr><th>parameter</th>"
      "<th>mean</th>"
      "<th>± "
      "sd</th><th>cov</th><th>5&#8201;%</th><th>50&#8201;%</th><th>95&#8201;%</th>{}<th>prior</"
      "th><th class=\"l\">in the prior</th><th></th></tr>\n",
      halves ? "<th>halves, sd</th>" : "");
  for (const auto& parameter : parameters) {
    html += Row(parameter, HasLogPrior(data.view.campaign, parameter.name()), halves);
  }
  html += "</table></div>\n";
  if (halves) {
    html +=
        "<p class=\"sub\">Halves: how far the means lie apart that either half of the runs "
        "gives alone, in sd of the posterior; about one or more asks for more runs.</p>\n";
  }
  if (!data.view.campaign.model.parameters.empty()) {
    html += "<p class=\"sub\">Held fixed: ";
    bool first = true;
    for (const auto& [name, value] : data.view.campaign.model.parameters) {
      html += (first ? "" : ", ") + Escape(NameForPeople(name)) + " = " + Escape(Number(value));
      first = false;
    }
    html += " (SI).</p>\n";
  }
  return html;
}

}  // namespace calib::report
