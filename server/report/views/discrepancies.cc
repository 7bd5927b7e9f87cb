#include "server/report/views/discrepancies.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "server/report/views/residual_group.h"

namespace calib::report {
namespace {

using Eigen::Index;

// From the least value of the control to the largest.
double PathOf(const std::vector<double>& control) {
  const auto [least, most] = std::minmax_element(control.begin(), control.end());
  return *most - *least;
}

// The size of a curve, to which discrepancies are relative.
double SizeOf(const Eigen::VectorXd& model) {
  return std::sqrt(model.squaredNorm() / static_cast<double>(std::max<Index>(1, model.size())));
}

Eigen::VectorXd PathAt(const campaign::Experiment& experiment,
                       const std::vector<std::size_t>& readings) {
  const std::vector<double> travelled = campaign::TravelledControl(experiment, 0);
  Eigen::VectorXd path(static_cast<Index>(readings.size()));
  for (std::size_t i = 0; i < readings.size(); ++i) {
    path[static_cast<Index>(i)] = travelled[readings[i]];
  }
  return path;
}

const FittedDiscrepancy* Find(const std::vector<FittedDiscrepancy>& discrepancies,
                              const campaign::Experiment& experiment,
                              const std::string& observable) {
  for (const FittedDiscrepancy& d : discrepancies) {
    if (d.observable == observable && d.control == experiment.control_name) return &d;
  }
  return nullptr;
}

int CurveOf(const CampaignView& fitted, const FittedDiscrepancy& discrepancy,
            const campaign::Experiment& experiment) {
  for (std::size_t c = 0; c < discrepancy.experiments.size(); ++c) {
    const campaign::Experiment& own = fitted.campaign.experiments[discrepancy.experiments[c]];
    if (own.test == experiment.test && own.settings == experiment.settings) {
      return static_cast<int>(c);
    }
  }
  return -1;
}

}  // namespace

std::vector<FittedDiscrepancy> FitDiscrepancies(
    const CampaignView& view, const std::vector<ExperimentPrediction>& predictions) {
  std::vector<FittedDiscrepancy> fitted;
  if (view.campaign.filter.noise != inference::NoiseMode::kGiven) return fitted;
  struct Curves {
    std::vector<std::size_t> experiments;
    std::vector<inference::DiscrepancyCurve> curves;
  };
  std::map<std::pair<std::string, std::string>, Curves> by_observable;
  for (std::size_t e = 0; e < view.campaign.experiments.size(); ++e) {
    const campaign::Experiment& experiment = view.campaign.experiments[e];
    // Without a control readings are merely counted: there is no path.
    if (experiment.role != campaign::Role::kCalibrate || experiment.path.empty()) continue;
    for (std::size_t j = 0; j < experiment.observables.size(); ++j) {
      if (experiment.observables[j].values.empty()) continue;
      const ResidualGroup group =
          MakeResidualGroup(view, experiment, j, predictions[e].observables[j]);
      const double size = group.readings.empty() ? 0 : SizeOf(group.model);
      if (!(size > 0) || !group.residual.allFinite()) continue;
      Curves& curves = by_observable[{experiment.observables[j].name, experiment.control_name}];
      curves.experiments.push_back(e);
      curves.curves.push_back({.path = PathAt(experiment, group.readings),
                               .residual = group.residual,
                               .covariance = group.covariance,
                               .scale = size});
    }
  }
  for (auto& [names, curves] : by_observable) {
    auto fit = inference::Discrepancy::Fit(std::move(curves.curves));
    if (!fit.ok()) continue;  // an error covariance that is singular: nothing to learn from
    fitted.push_back({.observable = names.first,
                      .control = names.second,
                      .experiments = std::move(curves.experiments),
                      .fit = *std::move(fit)});
  }
  return fitted;
}

inference::DiscrepancyBand DiscrepancyAt(const CampaignView& fitted,
                                         const std::vector<FittedDiscrepancy>& discrepancies,
                                         const campaign::Experiment& experiment,
                                         const std::string& observable,
                                         const Eigen::VectorXd& model) {
  const FittedDiscrepancy* found = Find(discrepancies, experiment, observable);
  if (found == nullptr || experiment.path.empty()) return {};
  std::vector<std::size_t> readings(experiment.control.size());
  for (std::size_t i = 0; i < readings.size(); ++i) readings[i] = i;
  return found->fit.At(CurveOf(fitted, *found, experiment), PathAt(experiment, readings),
                       SizeOf(model));
}

void AddDiscrepancies(const CampaignView& view,
                      const std::vector<ExperimentPrediction>& predictions,
                      Comparison& comparison) {
  const std::vector<FittedDiscrepancy> fitted = FitDiscrepancies(view, predictions);
  for (std::size_t e = 0; e < view.campaign.experiments.size(); ++e) {
    const campaign::Experiment& experiment = view.campaign.experiments[e];
    for (std::size_t j = 0; j < experiment.observables.size(); ++j) {
      const std::string& name = experiment.observables[j].name;
      const FittedDiscrepancy* found = Find(fitted, experiment, name);
      const std::vector<double>& mean = predictions[e].observables[j].mean;
      const bool all =
          std::all_of(mean.begin(), mean.end(), [](double m) { return std::isfinite(m); });
      if (found == nullptr || !all || mean.empty()) continue;
      const Eigen::VectorXd model =
          Eigen::Map<const Eigen::VectorXd>(mean.data(), static_cast<Index>(mean.size()));
      const inference::DiscrepancyBand band = DiscrepancyAt(view, fitted, experiment, name, model);
      if (band.mean.size() == 0) continue;
      Index largest = 0;
      band.mean.cwiseAbs().maxCoeff(&largest);
      const auto at = static_cast<std::size_t>(largest);
      comparison.discrepancies.push_back(
          {.experiment = experiment.name,
           .observable = name,
           .control_name = experiment.control_name,
           .heldout = experiment.role == campaign::Role::kValidate,
           .probability = found->fit.probability(),
           .log_bayes_factor = found->fit.log_bayes_factor(),
           .amplitude = SizeOf(band.mean),
           .length = std::exp(found->fit.log_length().mean),
           .throughout = std::exp(found->fit.log_length().mean) >= PathOf(experiment.control),
           .experiments = static_cast<int>(found->experiments.size()),
           .alike = found->fit.alike().mean,
           .mean = {band.mean.begin(), band.mean.end()},
           .sd = {band.sd.begin(), band.sd.end()},
           .largest = at,
           .largest_at = experiment.control[at],
           .segment = experiment.segment[at]});
    }
  }
}

}  // namespace calib::report
