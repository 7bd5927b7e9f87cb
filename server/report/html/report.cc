#include "server/report/html/report.h"

#include <cmath>
#include <utility>

#include "server/report/html/sections.h"
#include "server/report/text/html.h"
#include "server/report/views/discrepancies.h"

namespace calib::report {

std::string RenderReport(const CampaignView& view, const Story& story) {
  std::vector<ExperimentPrediction> predictions = PredictReadings(view);
  Comparison comparison = Compare(view, predictions);
  AddDiscrepancies(view, predictions, comparison);
  comparison.prior_conflicts = PriorConflicts(view);
  comparison.parameter_drift = story.drift;
  const ReportData data{view, std::move(predictions), std::move(comparison), story};
  std::string body = SummarySection(data);
  if (view.posterior.parameters_size() > 0) {
    body += ParameterSection(data) + FitSection(data) + MissingPhysicsSection(data) +
            DiagnosisSection(data) + PosteriorSection(data) + SensitivitySection(data) +
            EvolutionSection(data);
  } else if (campaign::RunsRowsOnly(view.campaign.method)) {
    body += "<p>Rows are run here and nothing is inferred, so there is no posterior.</p>\n";
  } else {
    body += "<p>No iteration is complete yet, so there is no posterior to show.</p>\n";
  }
  return Page(view.campaign.name + " – calibration report", body + RecordSection(data));
}

DisplayUnit ParameterUnit(const v1::Posterior::Parameter& parameter) {
  return UnitForPeople(parameter.name(), parameter.unit(), std::abs(parameter.mean()));
}

std::string LabelWithUnit(const std::string& name, const DisplayUnit& unit) {
  return NameForPeople(name) + (unit.label.empty() ? "" : " (" + unit.label + ")");
}

}  // namespace calib::report
