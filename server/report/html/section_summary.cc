#include <fmt/format.h>

#include "server/report/html/sections.h"
#include "server/report/text/html.h"
#include "server/report/views/warnings.h"

namespace calib::report {
namespace {

std::string Card(const std::string& value, const std::string& meaning) {
  return fmt::format("<div class=\"card\"><b>{}</b><span>{}</span></div>\n", Escape(value),
                     Escape(meaning));
}

std::string StateSentence(const CampaignView& view) {
  const v1::CampaignStatus& status = view.status;
  std::string text = fmt::format("Campaign {} is {}", status.campaign(), status.state());
  if (!status.reason().empty()) text += ": " + status.reason();
  return text + fmt::format(". {} of at most {} iterations, {} samples each, method {}.",
                            view.posterior.iterations(), view.status.max_iterations(),
                            view.campaign.samples, NameForPeople(status.method()));
}

}  // namespace

std::string SummarySection(const ReportData& data) {
  const CampaignView& view = data.view;
  const v1::Posterior& posterior = view.posterior;
  std::string html = fmt::format("<h1>{}</h1>\n<p class=\"sub\">{}</p>\n",
                                 Escape(view.campaign.name), Escape(StateSentence(view)));
  if (posterior.parameters_size() > 0) {
    html += "<div class=\"cards\">\n";
    html += Card(posterior.converged() ? "yes" : "not yet", "converged");
    if (view.campaign.filter.noise != inference::NoiseMode::kEssTarget) {
      html += Card(Number(data.comparison.rms_error, 3),
                   "error of the fitted data, sd (1: as expected)");
    }
    if (data.comparison.reduced_chi2) {
      html += Card(Number(*data.comparison.reduced_chi2, 3), "reduced chi-squared");
    }
    if (data.comparison.heldout_rms_error) {
      html += Card(Number(*data.comparison.heldout_rms_error, 3), "error of the held-out data, sd");
    }
    if (const auto* d = LatestOf(data.story.diagnoses, view.status.campaign())) {
      html += Card(d->effect.empty() ? NameForPeople(d->verdict) : NameForPeople(d->effect),
                   d->effect.empty() ? "verdict of the diagnosis" : "missing, says the diagnosis");
    }
    html += Card(Number(posterior.ess(), 3), "effective number of samples");
    html += Card(fmt::format("{} ± {}", Number(posterior.log_evidence(), 5),
                             Number(posterior.log_evidence_se(), 2)),
                 "log evidence");
    html += Card(std::to_string(posterior.model_evaluations()), "model evaluations");
    html += Card(Number(posterior.core_hours(), 3), "core hours");
    html += "</div>\n";
  }
  std::vector<std::string> warnings = Warnings(view);
  warnings.insert(warnings.end(), data.comparison.warnings.begin(), data.comparison.warnings.end());
  if (!warnings.empty()) {
    html += "<div class=\"warn\" role=\"note\"><b>Read this first</b><ul>\n";
    for (const std::string& warning : warnings) html += "<li>" + Escape(warning) + "</li>\n";
    html += "</ul></div>\n";
  }
  return html;
}

}  // namespace calib::report
