#pragma once
// The sections of the report, each HTML of its own.

#include <map>
#include <string>
#include <vector>

#include "server/report/text/people_units.h"
#include "server/report/views/campaign_view.h"
#include "server/report/views/comparison.h"
#include "server/report/views/predictions.h"
#include "server/report/views/story.h"

namespace calib::report {

/// What every section reads.
struct ReportData {
  const CampaignView& view;
  std::vector<ExperimentPrediction> predictions;
  Comparison comparison;
  const Story& story;
};

std::string SummarySection(
    const ReportData& data);  ///< section_summary.cc: name, key numbers, warnings
std::string ParameterSection(
    const ReportData& data);  ///< section_parameters.cc: the table of identified parameters
std::string FitSection(
    const ReportData& data);  ///< section_fit.cc: curves, residuals, misfit by stage
std::string MissingPhysicsSection(
    const ReportData& data);  ///< section_missing_physics.cc: where it fails, what was tried on it
std::string DiagnosisSection(
    const ReportData& data);  ///< section_diagnosis.cc: the verdict and what it rests on
/// section_effects.cc: of a diagnosis by probabilities, models, families, and what each effect
/// would change of the residuals.
std::string EffectsSection(const ReportData& data, const StoredDiagnosis& diagnosis);
std::string PosteriorSection(
    const ReportData& data);  ///< section_posterior.cc: marginals and pairs
std::string EvolutionSection(
    const ReportData& data);  ///< section_evolution.cc: iterations and loading path
std::string SensitivitySection(
    const ReportData& data);  ///< section_sensitivity.cc: which parameters move what
std::string RecordSection(const ReportData& data);  ///< section_record.cc: campaign and provenance

/// What a plot has along its horizontal axis: the control of an experiment, as shown.
struct ControlAxis {
  std::vector<double> values{};
  std::string label{};
};
ControlAxis ControlOf(const campaign::Experiment& experiment);
/// "friction = 0.3": the strengths of an effect; its own name before each goes without saying.
std::string OwnStrength(const std::string& effect, const std::map<std::string, double>& strength,
                        const std::map<std::string, std::string>& units);
/// Standard deviations of tempering say nothing about the measurements: they are not drawn.
bool ErrorsAreKnown(const CampaignView& view);
/// The effects that an effect is like, nearest first, with the angle between what they change.
std::string AlikeInWords(const TriedEffect& tried);

/// The unit in which a calibrated parameter is shown throughout.
DisplayUnit ParameterUnit(const v1::Posterior::Parameter& parameter);
/// "young modulus (GPa)"
std::string LabelWithUnit(const std::string& name, const DisplayUnit& unit);

}  // namespace calib::report
