#include "server/report/views/curves.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "dem/registry/catalog.h"
#include "server/messages/read_words.h"
#include "server/report/views/comparison.h"
#include "server/report/views/residual_group.h"

namespace calib::report {
namespace {

/// Chosen: as many as can be told apart in a figure.
constexpr std::size_t kBestRuns = 10;
constexpr std::size_t kOtherRuns = 10;

std::map<std::string, ExperimentCurves::Setting> SettingsOf(
    const campaign::Experiment& experiment) {
  std::map<std::string, ExperimentCurves::Setting> settings;
  const dem::TestInfo* test = dem::FindTest(experiment.test);
  for (const auto& [name, value] : experiment.settings) {
    settings[name] = {.value = value, .unit = "1"};
    if (test == nullptr) continue;
    for (const dem::ParameterInfo& info : test->settings) {
      if (info.name == name) settings[name].unit = info.unit;
    }
  }
  return settings;
}

std::vector<double> RunAt(const campaign::Experiment& experiment, const std::string& observable,
                          const StateHistory* history) {
  std::vector<double> values(experiment.control.size(), std::nan(""));
  if (history == nullptr) return values;
  const auto& names = history->observables;
  const auto at = std::find(names.begin(), names.end(), observable);
  const auto index = static_cast<int>(at - names.begin());
  for (const v1::State& state : history->states) {
    const auto step = static_cast<std::size_t>(state.load_step());
    if (step < values.size() && index < state.values_size()) values[step] = state.values(index);
  }
  return values;
}

ObservableCurves CurvesOf(const CampaignView& view, const campaign::Experiment& experiment,
                          std::size_t j, const ExperimentPrediction* prediction) {
  const campaign::MeasuredObservable& measured = experiment.observables[j];
  const std::vector<double> none(experiment.control.size(), std::nan(""));
  ObservableCurves curves{.name = measured.name,
                          .unit = measured.unit,
                          .values = measured.values.empty() ? none : measured.values,
                          .sd = none,
                          .total_sd = none,
                          .residual = none};
  if (!measured.values.empty() && (prediction != nullptr || !measured.sd.empty())) {
    for (std::size_t i = 0; i < none.size(); ++i) curves.sd[i] = ErrorOf(view, measured, i);
  }
  curves.total_sd = curves.sd;
  if (prediction == nullptr || measured.values.empty()) {
    curves.prediction = {.mean = none, .q05 = none, .q95 = none};
    curves.prediction.bands.fill(none);
    return curves;
  }
  curves.prediction = prediction->observables[j];
  const ResidualGroup group = MakeResidualGroup(view, experiment, j, curves.prediction);
  for (std::size_t k = 0; k < group.readings.size(); ++k) {
    const auto at = static_cast<Eigen::Index>(k);
    const double sd = std::sqrt(group.covariance(at, at));
    curves.total_sd[group.readings[k]] = sd;
    curves.residual[group.readings[k]] = group.residual[at] / sd;
  }
  return curves;
}

}  // namespace

std::vector<DrawnRun> RunsToDraw(const std::vector<v1::Sample>& samples) {
  std::vector<const v1::Sample*> finished;
  std::vector<const v1::Sample*> others;
  for (const v1::Sample& sample : samples) {
    const auto status = messages::StatusOf(sample);
    if (status == campaign::EvaluationStatus::kFinished && std::isfinite(sample.log_likelihood())) {
      finished.push_back(&sample);
    } else if (status == campaign::EvaluationStatus::kStoppedEarly ||
               status == campaign::EvaluationStatus::kRunning) {
      others.push_back(&sample);
    }
  }
  std::stable_sort(finished.begin(), finished.end(), [](const auto* a, const auto* b) {
    return a->log_likelihood() > b->log_likelihood();
  });
  finished.resize(std::min(finished.size(), kBestRuns));
  if (others.size() > kOtherRuns) {
    others.erase(others.begin(), others.end() - static_cast<std::ptrdiff_t>(kOtherRuns));
  }
  std::vector<DrawnRun> runs;
  const auto add = [&runs](const v1::Sample& sample, std::optional<int> rank) {
    runs.push_back({.sample = sample.index(),
                    .status = sample.status(),
                    .rank = rank,
                    .weight = sample.weight(),
                    .log_likelihood = sample.log_likelihood()});
  };
  int rank = 0;
  for (const v1::Sample* sample : finished) add(*sample, ++rank);
  for (const v1::Sample* sample : others) add(*sample, std::nullopt);
  return runs;
}

std::vector<ExperimentCurves> Curves(const CampaignView& view,
                                     const std::vector<ExperimentPrediction>& predictions) {
  const std::vector<DrawnRun> runs = RunsToDraw(view.samples);
  std::vector<ExperimentCurves> all;
  for (std::size_t e = 0; e < view.campaign.experiments.size(); ++e) {
    const campaign::Experiment& experiment = view.campaign.experiments[e];
    ExperimentCurves curves{
        .experiment = experiment.name,
        .test = experiment.test,
        .heldout = experiment.role == campaign::Role::kValidate,
        .settings = SettingsOf(experiment),
        .control = experiment.control_name,
        .control_unit = experiment.control_name.empty() ? "" : experiment.control_unit,
        .control_values = experiment.control,
        .segments = experiment.segment,
        .runs = runs};
    for (std::size_t j = 0; j < experiment.observables.size(); ++j) {
      ObservableCurves observable =
          CurvesOf(view, experiment, j, predictions.empty() ? nullptr : &predictions[e]);
      for (const DrawnRun& run : runs) {
        const auto history = view.states.find({experiment.name, run.sample});
        observable.runs.push_back(RunAt(experiment, observable.name,
                                        history == view.states.end() ? nullptr : &history->second));
      }
      curves.observables.push_back(std::move(observable));
    }
    all.push_back(std::move(curves));
  }
  return all;
}

}  // namespace calib::report
