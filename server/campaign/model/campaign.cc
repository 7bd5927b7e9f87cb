#include "server/campaign/model/campaign.h"

#include <algorithm>
#include <cmath>

#include "server/campaign/model/race.h"
#include "server/campaign/model/run_settings.h"

namespace calib::campaign {

bool RunsRowsOnly(const Campaign& campaign) {
  return campaign.method != nullptr && RunsRowsOnly(*campaign.method);
}

bool RunsAreAdded(const Campaign& campaign) {
  return campaign.method != nullptr && campaign.method->chosen_by() == ChosenBy::kRequest;
}

std::vector<double> TravelledControl(const Experiment& experiment, double correlation_length) {
  constexpr double kSame = 1e-3;     // of the median: readings so close are at one control
  constexpr double kClosest = 0.01;  // in correlation lengths, of those
  std::vector<double> pieces;
  double at = experiment.control_start;
  double piece = 0;  // since the last reading
  for (const dem::ControlPoint& point : experiment.path) {
    piece += std::abs(point.target - at);
    at = point.target;
    if (point.load_step < 0) continue;
    pieces.push_back(piece);
    piece = 0;
  }
  std::vector<double> sorted = pieces;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  const double near = sorted.empty() ? 0 : kSame * *middle;
  std::vector<double> travelled;
  double length = 0;
  for (const double apart : pieces) {
    const bool same = !travelled.empty() && apart <= near;
    length += same ? std::max(apart, kClosest * correlation_length) : apart;
    travelled.push_back(length);
  }
  return travelled;
}

std::vector<Eigen::Index> RowsRead(const MeasuredObservable& observable) {
  std::vector<Eigen::Index> rows;
  for (std::size_t i = 0; i < observable.values.size(); ++i) {
    if (!std::isnan(observable.values[i])) rows.push_back(static_cast<Eigen::Index>(i));
  }
  return rows;
}

double ErrorOf(const NoiseLaw& law, double value) {
  return law.absolute ? *law.absolute : std::hypot(law.relative * value, law.floor);
}

NoiseLaw LawOf(const MeasuredObservable& observable) {
  if (observable.noise) return *observable.noise;
  if (observable.sd.empty()) return {.relative = 0, .floor = 0, .absolute = 0};
  const std::vector<Eigen::Index> rows = RowsRead(observable);
  double sum = 0;
  for (const Eigen::Index row : rows) {
    sum += observable.sd[static_cast<std::size_t>(row)] / static_cast<double>(rows.size());
  }
  return {.relative = 0, .floor = 0, .absolute = sum};
}

double CorrelationLengthOf(const std::vector<double>& control,
                           const MeasuredObservable& observable) {
  const Eigen::MatrixXd& c = observable.covariance;
  if (c.rows() == 0) return observable.correlation_length;
  double decay = 0;
  double way = 0;
  const std::vector<Eigen::Index> rows = RowsRead(observable);
  for (std::size_t k = 1; k < rows.size(); ++k) {
    const Eigen::Index i = rows[k];
    const Eigen::Index before = rows[k - 1];
    const double correlation = c(i, before) / std::sqrt(c(i, i) * c(before, before));
    if (!(correlation > 0)) return 0;
    decay -= std::log(std::min(1.0, correlation));
    way +=
        std::abs(control[static_cast<std::size_t>(i)] - control[static_cast<std::size_t>(before)]);
  }
  return decay > 0 ? way / decay : 0;
}

double ScatterShare(const Experiment& experiment) {
  if (!experiment.specimen_grains || experiment.specimens.empty()) return 1;
  double grains = 0;
  if (const auto* file = std::get_if<PackingFile>(&experiment.specimens.front())) {
    grains = static_cast<double>(file->packing.x.size());
  } else if (const auto* recipe = std::get_if<dem::PackingRecipe>(&experiment.specimens.front())) {
    grains = recipe->particles;
  } else {
    return 1;  // nobody knows how many a program's specimen has
  }
  return std::min(1.0, grains / *experiment.specimen_grains);
}

std::size_t PackingsOfAll(const Campaign& campaign) {
  std::size_t fewest = 0;
  for (const Experiment& experiment : campaign.experiments) {
    const std::size_t packings = experiment.specimens.size();
    if (experiment.role == Role::kCalibrate && packings > 1) {
      fewest = fewest == 0 ? packings : std::min(fewest, packings);
    }
  }
  return fewest;
}

Eigen::VectorXd ScatterShares(const Campaign& campaign, const inference::DataSet& data) {
  Eigen::VectorXd shares(static_cast<Eigen::Index>(data.readings.size()));
  for (Eigen::Index k = 0; k < shares.size(); ++k) {
    const Experiment& experiment = campaign.experiments[static_cast<std::size_t>(
        data.readings[static_cast<std::size_t>(k)].experiment)];
    shares[k] = experiment.specimens.size() < 2 ? -1 : ScatterShare(experiment);
  }
  return shares;
}

inference::DataSet MakeDataSet(const Campaign& campaign, Role role) {
  inference::DataSet data;
  for (std::size_t e = 0; e < campaign.experiments.size(); ++e) {
    const Experiment& experiment = campaign.experiments[e];
    data.ess_weights.emplace_back();
    for (const MeasuredObservable& observable : experiment.observables) {
      data.ess_weights.back().push_back(observable.ess_weight);
    }
    if (experiment.role != role) continue;
    std::vector<std::vector<double>> travelled;
    for (const MeasuredObservable& observable : experiment.observables) {
      travelled.push_back(TravelledControl(experiment, observable.correlation_length));
    }
    for (std::size_t i = 0; i < experiment.control.size(); ++i) {
      for (std::size_t j = 0; j < experiment.observables.size(); ++j) {
        const MeasuredObservable& observable = experiment.observables[j];
        if (observable.values.empty()) continue;         // to be predicted
        if (std::isnan(observable.values[i])) continue;  // missing
        data.readings.push_back({.experiment = static_cast<int>(e),
                                 .observable = static_cast<int>(j),
                                 .load_step = static_cast<int>(i),
                                 .control = travelled[j][i],
                                 .value = observable.values[i],
                                 .sd = observable.sd.empty() ? 0 : observable.sd[i]});
      }
    }
    for (std::size_t j = 0; j < experiment.observables.size(); ++j) {
      const double length = experiment.observables[j].correlation_length;
      if (length > 0) {
        data.correlations.push_back({static_cast<int>(e), static_cast<int>(j), length});
      }
      const Eigen::MatrixXd& covariance = experiment.observables[j].covariance;
      if (covariance.size() > 0) {
        const std::vector<Eigen::Index> rows = RowsRead(experiment.observables[j]);
        data.covariances.push_back(
            {static_cast<int>(e), static_cast<int>(j), Eigen::MatrixXd(covariance(rows, rows))});
      }
    }
  }
  for (const SharedNoise& shared : campaign.shared_noise) {
    data.noise_groups.push_back({.members = shared.members, .prior = shared.prior});
  }
  if (role == Role::kCalibrate) data.model_errors = campaign.model_errors;
  return data;
}

std::vector<inference::Prior> MarginalPriors(const Campaign& campaign) {
  std::vector<inference::Prior> priors;
  for (const CalibratedParameter& parameter : campaign.parameters) {
    priors.push_back(parameter.prior);
  }
  return priors;
}

inference::JointPrior Priors(const Campaign& campaign) {
  return campaign.tied_prior ? *campaign.tied_prior : MarginalPriors(campaign);
}

int StreamOf(const Campaign& campaign, int sample) {
  const auto row = static_cast<std::size_t>(sample);
  return campaign.table && row < campaign.table->like.size() ? campaign.table->like[row] : sample;
}

inference::Proposal FirstProposalOf(const Campaign& campaign) {
  inference::Proposal proposal;
  if (!campaign.first_proposal) return proposal;
  const auto d = static_cast<Eigen::Index>(campaign.parameters.size());
  const inference::JointPrior priors = Priors(campaign);
  inference::MixtureComponent component{
      .weight = 1, .mean = Eigen::VectorXd::Zero(d), .covariance = Eigen::MatrixXd::Identity(d, d)};
  for (Eigen::Index j = 0; j < d; ++j) {
    const auto index = static_cast<std::size_t>(j);
    const auto place = campaign.first_proposal->places.find(campaign.parameters[index].name);
    if (place == campaign.first_proposal->places.end()) continue;
    const inference::Prior& prior = priors[index];
    component.mean[j] = prior.ToStandard(place->second.center);
    const double sd = place->second.sd * std::exp(prior.LogJacobian(place->second.center));
    component.covariance(j, j) = std::min(1.0, sd * sd);
  }
  proposal.components.push_back(std::move(component));
  proposal.defensive_share = campaign.first_proposal->prior_share;
  proposal.log_acceptance = inference::LogMassInSupport(proposal.components, priors);
  return proposal;
}

bool HasOwnEngine(const Campaign& campaign) { return !campaign.precomputed && !campaign.program; }

bool HasNamesOfItsOwn(const Campaign& campaign, const Experiment& experiment) {
  return campaign.precomputed || (campaign.program && experiment.test.empty());
}

dem::Scenario MakeScenario(const Campaign& campaign, const Experiment& experiment,
                           const RunOf& run) {
  dem::Scenario scenario;
  scenario.model = ModelOf(campaign, experiment, run.values);
  scenario.test = experiment.test;
  scenario.settings = experiment.settings;
  scenario.materials = experiment.materials;
  if (!experiment.specimens.empty()) {
    const auto index = static_cast<std::size_t>(run.stream) % experiment.specimens.size();
    if (const auto* file = std::get_if<PackingFile>(&experiment.specimens[index])) {
      scenario.packing = file->packing;
    }
    if (!scenario.materials.grains.empty()) scenario.materials.seed = campaign.seed + index;
  }
  for (const auto& [name, file] : experiment.meshes) scenario.meshes[name] = file.mesh;
  scenario.consolidation = experiment.consolidation;
  scenario.initial_stress = experiment.initial_stress;
  scenario.loading_rate = experiment.loading_rate;
  scenario.staging = experiment.staging;
  scenario.path = experiment.path;
  scenario.seed = campaign.seed + static_cast<std::uint64_t>(run.stream);
  ChangeSettings(campaign, experiment, run.values, scenario);
  ChangeNumerics(campaign, experiment, run, scenario);
  return scenario;
}

}  // namespace calib::campaign
