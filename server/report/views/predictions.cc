#include "server/report/views/predictions.h"

#include <algorithm>
#include <cmath>

#include "server/messages/read_words.h"
#include "server/report/views/weighted_statistics.h"

namespace calib::report {
namespace {

constexpr double kFewestRuns = 2;  // effective, of a covariance

// Ascending: what WeightedQuantiles is asked for, and where those of kBandProbabilities stand.
constexpr std::array kQuantiles = {0.025, 0.05, 0.25, 0.5, 0.75, 0.95, 0.975};
constexpr std::size_t kAt05 = 1;
constexpr std::size_t kAt95 = 5;
constexpr std::array<std::size_t, kBandProbabilities.size()> kBandsAt = {0, 2, 3, 4, 6};

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

struct Counted {
  std::vector<const v1::Sample*> samples;
  std::vector<double> weights;
};

Counted WeightedSamples(const CampaignView& view) {
  Counted counted;
  for (const v1::Sample& sample : view.samples) {
    if (!(sample.weight() > 0)) continue;
    counted.samples.push_back(&sample);
    counted.weights.push_back(sample.weight());
  }
  return counted;
}

// Runs at equally weighted draws from the posterior, made after the last iteration.
Counted PosteriorDraws(const CampaignView& view) {
  Counted counted;
  for (const v1::Sample& sample : view.samples) {
    const bool ensemble = sample.iteration() < view.posterior.iterations();
    if (ensemble || messages::PurposeOf(sample) == campaign::SamplePurpose::kReplicate) continue;
    counted.samples.push_back(&sample);
    counted.weights.push_back(1);
  }
  return counted;
}

// values: [reading][run]. Runs that have not reached every reading do not count.
void SpreadOf(const std::vector<std::vector<double>>& values, const std::vector<double>& weights,
              ObservablePrediction& out) {
  const auto readings = static_cast<Eigen::Index>(values.size());
  double sum = 0;
  double squares = 0;
  std::vector<std::size_t> whole;
  for (std::size_t s = 0; s < weights.size(); ++s) {
    if (std::any_of(values.begin(), values.end(),
                    [s](const std::vector<double>& v) { return !std::isfinite(v[s]); })) {
      continue;
    }
    whole.push_back(s);
    sum += weights[s];
  }
  for (const std::size_t s : whole) squares += weights[s] * weights[s] / (sum * sum);
  if (!(squares > 0) || 1 / squares < kFewestRuns) return;
  Eigen::MatrixXd runs(readings, static_cast<Eigen::Index>(whole.size()));
  Eigen::VectorXd share(runs.cols());
  for (Eigen::Index k = 0; k < runs.cols(); ++k) {
    const std::size_t s = whole[static_cast<std::size_t>(k)];
    share[k] = weights[s] / sum;
    for (Eigen::Index i = 0; i < readings; ++i) {
      runs(i, k) = values[static_cast<std::size_t>(i)][s];
    }
  }
  const Eigen::VectorXd mean = runs * share;
  runs.colwise() -= mean;
  out.of_runs = runs * share.asDiagonal() * runs.transpose() / (1 - squares);
  out.runs = 1 / squares;
}

ExperimentPrediction FromRuns(const CampaignView& view, const campaign::Experiment& experiment,
                              const Counted& counted, bool band) {
  Ensemble ensemble(
      experiment.observables.size(),
      std::vector<std::vector<double>>(experiment.control.size(),
                                       std::vector<double>(counted.samples.size(), std::nan(""))));
  ExperimentPrediction prediction;
  for (std::size_t s = 0; s < counted.samples.size(); ++s) {
    const auto history = view.states.find({experiment.name, counted.samples[s]->index()});
    if (history == view.states.end()) continue;
    ++prediction.samples;
    Place(experiment, history->second, s, ensemble);
  }
  for (const auto& observable : ensemble) {
    ObservablePrediction out;
    for (const std::vector<double>& values : observable) {
      out.mean.push_back(WeightedMean(values, counted.weights));
      const std::vector<double> quantiles =
          band ? WeightedQuantiles(values, counted.weights, kQuantiles)
               : std::vector<double>(kQuantiles.size(), std::nan(""));
      out.q05.push_back(quantiles[kAt05]);
      out.q95.push_back(quantiles[kAt95]);
      for (std::size_t k = 0; k < kBandsAt.size(); ++k) {
        out.bands[k].push_back(quantiles[kBandsAt[k]]);
      }
    }
    if (band && experiment.role == campaign::Role::kValidate) {
      SpreadOf(observable, counted.weights, out);
    }
    prediction.observables.push_back(std::move(out));
  }
  return prediction;
}

ExperimentPrediction FromBands(const v1::Posterior& posterior,
                               const campaign::Experiment& experiment) {
  ExperimentPrediction prediction;
  prediction.samples = posterior.emulator().runs();
  for (const campaign::MeasuredObservable& observable : experiment.observables) {
    const std::vector<double> none(experiment.control.size(), std::nan(""));
    ObservablePrediction& out = prediction.observables.emplace_back(
        ObservablePrediction{.mean = none, .q05 = none, .q95 = none});
    out.bands.fill(none);
    for (const v1::Posterior::Band& band : posterior.bands()) {
      if (band.experiment() != experiment.name || band.observable() != observable.name) continue;
      for (int i = 0; i < band.load_step_size(); ++i) {
        const auto step = static_cast<std::size_t>(band.load_step(i));
        if (step >= none.size()) continue;
        out.mean[step] = band.mean(i);
        out.q05[step] = band.q05(i);
        out.q95[step] = band.q95(i);
        const google::protobuf::RepeatedField<double>* const quantiles[] = {
            &band.q025(), &band.q25(), &band.q50(), &band.q75(), &band.q975()};
        for (std::size_t k = 0; k < out.bands.size(); ++k) {
          if (i < quantiles[k]->size()) out.bands[k][step] = quantiles[k]->Get(i);
        }
      }
    }
  }
  return prediction;
}

}  // namespace

std::vector<ExperimentPrediction> PredictReadings(const CampaignView& view) {
  const bool emulated = messages::SourceOf(view.posterior) == campaign::PosteriorSource::kEmulator;
  const bool band = messages::SourceOf(view.posterior) != campaign::PosteriorSource::kNone;
  const Counted weighted = WeightedSamples(view);
  const Counted draws = emulated ? PosteriorDraws(view) : Counted{};
  std::vector<ExperimentPrediction> predictions;
  for (const campaign::Experiment& experiment : view.campaign.experiments) {
    if (!emulated) {
      predictions.push_back(FromRuns(view, experiment, weighted, band));
    } else if (experiment.role == campaign::Role::kValidate) {
      predictions.push_back(FromRuns(view, experiment, draws, band));
    } else {
      predictions.push_back(FromBands(view.posterior, experiment));
    }
  }
  return predictions;
}

}  // namespace calib::report
