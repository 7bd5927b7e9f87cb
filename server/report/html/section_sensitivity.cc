#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "server/report/html/sections.h"
#include "server/report/text/html.h"
#include "server/report/views/sensitivity.h"

namespace calib::report {
namespace {

// A share of 0 to 1 as a bar.
std::string ShareBar(const std::string& parameter, const Quantity& q, double share) {
  constexpr double kWidth = 60;
  return fmt::format(
      "<svg viewBox=\"0 0 {0} 10\" width=\"{0}\" height=\"10\" role=\"img\"><title>share of {1} in "
      "the {2} of {3}</title><rect class=\"rangebar\" x=\"0\" y=\"2\" width=\"{0}\" height=\"6\" "
      "rx=\"3\"/><rect class=\"rangepart\" x=\"0\" y=\"2\" width=\"{4:.2f}\" height=\"6\" "
      "rx=\"2\"/></svg>",
      kWidth, Escape(NameForPeople(parameter)), Escape(NameForPeople(q.name)), Escape(q.experiment),
      kWidth * std::clamp(share, 0.0, 1.0));
}

bool Has(const Eigen::VectorXd& values, int j) {
  return j < values.size() && std::isfinite(values[j]);
}

std::string Correlation(const char* where, const inference::OutputSensitivity& over, int j) {
  if (!Has(over.correlation, j)) return "";
  const std::string error =
      Has(over.correlation_error, j) ? fmt::format(" ± {:.2f}", over.correlation_error[j]) : "";
  return fmt::format("<br><span class=\"sub\">{} {:+.2f}{}</span>", where, over.correlation[j],
                     error);
}

// One parameter's part in one output.
std::string Cell(const std::string& parameter, const Quantity& q, int j) {
  const inference::SobolIndices& indices = q.prior.indices;
  std::string html = "<td class=\"l\">";
  if (Has(indices.total, j)) {
    html += ShareBar(parameter, q, indices.total[j]) + fmt::format("{:.2f}", indices.total[j]);
    if (Has(indices.total_error, j)) html += fmt::format(" ± {:.2f}", indices.total_error[j]);
  }
  if (q.prior.out_of_reach) html += "<span class=\"sub\">prior: –</span>";
  return html + Correlation("prior", q.prior, j) + Correlation("posterior", q.posterior, j) +
         "</td>";
}

std::string Row(const Quantity& q, const std::vector<std::string>& parameters) {
  std::string html = fmt::format("<tr><td>{}<br><span class=\"sub\">{}</span></td>",
                                 Escape(NameForPeople(q.name)), Escape(q.experiment));
  if (!q.prior.Explains()) {
    return html + fmt::format(
                      "<td class=\"l\" colspan=\"{}\">the emulator of its {} runs explains "
                      "too little of their variance to say</td></tr>\n",
                      parameters.size() + 1, q.runs);
  }
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    html += Cell(parameters[j], q, static_cast<int>(j));
  }
  const std::string known = q.posterior.correlation.size() == 0
                                ? "–"
                                : Escape(NumberWithUnit(q.posterior.mean, q.name, q.unit, 4) +
                                         " ± " + NumberWithUnit(q.posterior.sd, q.name, q.unit, 2));
  return html +
         fmt::format("<td>{}<br><span class=\"sub\">{} runs, {} explained</span></td></tr>\n",
                     known, q.runs, Percent(q.prior.explained, 2));
}

}  // namespace

std::string SensitivitySection(const ReportData& data) {
  const auto sensitivity = AnalyseCampaign(data.view);
  std::string html = "<h2>What moves what</h2>\n";
  if (!sensitivity.ok()) {
    return html + "<p>" + Escape(std::string(sensitivity.status().message())) + "</p>\n";
  }
  html +=
      sensitivity->independent
          ? "<p class=\"sub\">Bars: the part that a parameter has in the variance of a bulk "
            "property, or of the last reading, over the prior, alone and with others (total "
            "Sobol index). Below: rank correlations, over the prior and over the posterior; "
            "their sign says which way. All from emulators of the finished runs, whose error "
            "is part of the ±.</p>\n"
          : "<p class=\"sub\">Rank correlations of bulk properties and last readings with the "
            "parameters, over the prior and over the posterior, from emulators of the finished "
            "runs, whose error is part of the ±. Correlated or constrained priors have no Sobol "
            "indices.</p>\n";
  html += "<div class=\"scroll\"><table>\n<tr><th>output</th>";
  for (const std::string& parameter : sensitivity->parameters) {
    html += "<th class=\"l\">" + Escape(NameForPeople(parameter)) + "</th>";
  }
  html += "<th>one run of the posterior</th></tr>\n";
  for (const Quantity& quantity : sensitivity->quantities) {
    html += Row(quantity, sensitivity->parameters);
  }
  html += "</table></div>\n";
  for (const std::string& what : sensitivity->left_out) {
    html += "<p class=\"sub\">Left out: " + Escape(what) + "</p>\n";
  }
  return html;
}

}  // namespace calib::report
