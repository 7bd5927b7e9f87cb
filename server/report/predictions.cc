#include "server/report/predictions.h"

#include <algorithm>
#include <cmath>

#include "server/report/weighted_statistics.h"

namespace calib::report {
namespace {

// [observable][reading][sample of positive weight]
using Ensemble = std::vector<std::vector<std::vector<double>>>;

void Place(const campaign::Experiment& experiment, const StateHistory& history, std::size_t column,
           Ensemble& ensemble) {
  for (std::size_t j = 0; j < experiment.observables.size(); ++j) {
    const auto at = std::find(history.observables.begin(), history.observables.end(),
                              experiment.observables[j].name);
    if (at == history.observables.end()) continue;
    const auto index = static_cast<int>(at - history.observables.begin());
    for (const v1::State& state : history.states) {
      const auto step = static_cast<std::size_t>(state.load_step());
      if (step < ensemble[j].size() && index < state.values_size()) {
        ensemble[j][step][column] = state.values(index);
      }
    }
  }
}

}  // namespace

std::vector<ExperimentPrediction> PredictReadings(const CampaignView& view) {
  std::vector<const v1::Sample*> counted;
  std::vector<double> weights;
  for (const v1::Sample& sample : view.samples) {
    if (!(sample.weight() > 0)) continue;
    counted.push_back(&sample);
    weights.push_back(sample.weight());
  }
  std::vector<ExperimentPrediction> predictions;
  for (const campaign::Experiment& experiment : view.campaign.experiments) {
    const std::size_t readings = experiment.control.size();
    Ensemble ensemble(experiment.observables.size(),
                      std::vector<std::vector<double>>(
                          readings, std::vector<double>(counted.size(), std::nan(""))));
    ExperimentPrediction prediction;
    for (std::size_t s = 0; s < counted.size(); ++s) {
      const auto history = view.states.find({experiment.name, counted[s]->index()});
      if (history == view.states.end()) continue;
      ++prediction.samples;
      Place(experiment, history->second, s, ensemble);
    }
    for (const auto& observable : ensemble) {
      ObservablePrediction out;
      for (const std::vector<double>& values : observable) {
        out.mean.push_back(WeightedMean(values, weights));
        out.q05.push_back(WeightedQuantile(values, weights, 0.05));
        out.q95.push_back(WeightedQuantile(values, weights, 0.95));
      }
      prediction.observables.push_back(std::move(out));
    }
    predictions.push_back(std::move(prediction));
  }
  return predictions;
}

}  // namespace calib::report
