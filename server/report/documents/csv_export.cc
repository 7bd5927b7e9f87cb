#include "server/report/documents/csv_export.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "server/report/views/comparison.h"

namespace calib::report {
namespace {

std::string Cell(double value) { return std::isfinite(value) ? fmt::format("{:.17g}", value) : ""; }

// Union of the observables, in order of first mention.
std::vector<std::string> AllObservables(const CampaignView& view) {
  std::vector<std::string> names;
  for (const auto& [key, history] : view.states) {
    for (const std::string& name : history.observables) {
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
    }
  }
  return names;
}

}  // namespace

std::string SamplesCsv(const CampaignView& view) {
  std::string csv = "index,iteration,status,weight,log_likelihood";
  for (const campaign::CalibratedParameter& parameter : view.campaign.parameters) {
    csv += "," + parameter.name;
  }
  csv += "\n";
  for (const v1::Sample& s : view.samples) {
    csv += fmt::format("{},{},{},{},{}", s.index(), s.iteration(), s.status(), Cell(s.weight()),
                       Cell(s.log_likelihood()));
    for (const double value : s.parameters()) csv += "," + Cell(value);
    csv += "\n";
  }
  return csv;
}

std::string StatesCsv(const CampaignView& view) {
  const std::vector<std::string> names = AllObservables(view);
  std::string csv = "sample,experiment,load_step";
  for (const std::string& name : names) csv += "," + name;
  csv += "\n";
  for (const auto& [key, history] : view.states) {
    for (const v1::State& state : history.states) {
      csv += fmt::format("{},{},{}", key.second, key.first, state.load_step());
      for (const std::string& name : names) {
        const auto at = std::find(history.observables.begin(), history.observables.end(), name);
        const auto index = static_cast<int>(at - history.observables.begin());
        csv += "," + (at != history.observables.end() && index < state.values_size()
                          ? Cell(state.values(index))
                          : "");
      }
      csv += "\n";
    }
  }
  return csv;
}

std::string PosteriorCsv(const v1::Posterior& posterior) {
  std::string csv = "parameter,unit,mean,sd,cov,q05,q50,q95,at_bound\n";
  for (const auto* list : {&posterior.parameters(), &posterior.members()}) {
    for (const auto& p : *list) {
      csv += fmt::format("{},{},{},{},{},{},{},{},{}\n", p.name(), p.unit(), Cell(p.mean()),
                         Cell(p.sd()), Cell(p.cov()), Cell(p.q05()), Cell(p.q50()), Cell(p.q95()),
                         p.at_bound());
    }
  }
  return csv;
}

std::string FitCsv(const CampaignView& view, const std::vector<ExperimentPrediction>& predictions) {
  std::string csv =
      "experiment,role,load_step,control,observable,measured,sd,predicted_mean,predicted_q05,"
      "predicted_q95,segment\n";
  for (std::size_t e = 0; e < view.campaign.experiments.size(); ++e) {
    const campaign::Experiment& experiment = view.campaign.experiments[e];
    for (std::size_t j = 0; j < experiment.observables.size(); ++j) {
      const campaign::MeasuredObservable& observable = experiment.observables[j];
      const ObservablePrediction& prediction = predictions[e].observables[j];
      for (std::size_t i = 0; i < experiment.control.size(); ++i) {
        csv +=
            fmt::format("{},{},{},{},{},{},{},{},{},{},{}\n", experiment.name,
                        experiment.role == campaign::Role::kValidate ? "validate" : "calibrate", i,
                        Cell(experiment.control[i]), observable.name, Cell(observable.values[i]),
                        Cell(ErrorOf(view, observable, i)), Cell(prediction.mean[i]),
                        Cell(prediction.q05[i]), Cell(prediction.q95[i]), experiment.segment[i]);
      }
    }
  }
  return csv;
}

}  // namespace calib::report
