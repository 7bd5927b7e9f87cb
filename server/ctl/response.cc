#include "server/ctl/response.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/catalog/catalog.h"
#include "inference/emulator/training_set.h"
#include "inference/filter/iterative_filter.h"
#include "inference/sampling/philox.h"

namespace calib::ctl {
namespace {

using Eigen::Index;
using report::RunsOf;
using report::RunTable;

constexpr int kSpread = 3000;   // points over the prior
constexpr int kRefined = 1000;  // about the best of them, in each round
constexpr int kRounds = 4;
// Of an emulator to judge by, noise sd: its error beyond the scatter of single runs.
constexpr double kMostUncovered = 2;
constexpr Index kDraws = 400;       // of measurements
constexpr int kRunsAbout = 5;       // the best point, of a campaign or a warm fit
constexpr double kMostUnknown = 3;  // noise sd of what the emulator may not know of a point

Eigen::MatrixXd Standard(const inference::JointPrior& priors, const Eigen::MatrixXd& values) {
  Eigen::MatrixXd standard(values.rows(), values.cols());
  for (Index j = 0; j < values.cols(); ++j) {
    for (Index i = 0; i < values.rows(); ++i) {
      standard(i, j) = priors[static_cast<std::size_t>(j)].ToStandard(values(i, j));
    }
  }
  return standard;
}

// Correlated errors of the readings, one as variance.
Eigen::MatrixXd NoiseCorrelation(const inference::DataSet& data) {
  const auto t = static_cast<Index>(data.readings.size());
  Eigen::MatrixXd correlation = Eigen::MatrixXd::Identity(t, t);
  for (const auto& [key, readings] : inference::GroupsOf(data)) {
    const Eigen::MatrixXd of_group = inference::ErrorCorrelation(data, key, readings);
    for (Index i = 0; i < of_group.rows(); ++i) {
      for (Index j = 0; j < of_group.cols(); ++j) {
        correlation(readings[static_cast<std::size_t>(i)], readings[static_cast<std::size_t>(j)]) =
            of_group(i, j);
      }
    }
  }
  return correlation;
}

// Which part of the data each reading belongs to: its experiment, or its stage of loading where
// only one experiment is fitted.
std::vector<int> PartsOf(const campaign::Campaign& campaign, const inference::DataSet& data) {
  std::vector<int> parts;
  std::set<int> experiments;
  for (const inference::Reading& reading : data.readings) {
    parts.push_back(reading.experiment);
    experiments.insert(reading.experiment);
  }
  if (experiments.size() != 1) return parts;
  std::map<std::string, int> stages;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    const inference::Reading& reading = data.readings[k];
    const auto& segment =
        campaign.experiments[static_cast<std::size_t>(reading.experiment)].segment;
    const auto step = static_cast<std::size_t>(reading.load_step);
    const std::string stage = step < segment.size() ? segment[step] : "";
    parts[k] = stages.emplace(stage, static_cast<int>(stages.size())).first->second;
  }
  return parts;
}

// Noise, nuisance and scatter of measurements; `missed` holds what the emulator misses of single
// runs, n x T.
void DrawMeasurements(const FittedCampaign& base, const Eigen::MatrixXd& missed,
                      const std::vector<Eigen::VectorXd>& nuisance, Response& response) {
  const campaign::Campaign& campaign = base.view().campaign;
  const report::ScatteredReadings& readings = base.readings();
  const inference::DataSet plain = campaign::MakeDataSet(campaign);
  const auto t = static_cast<Index>(plain.readings.size());
  Eigen::VectorXd unit(t);     // of the noise in the sd of histories
  Eigen::VectorXd scatter(t);  // of the measurement, of what is missed of a run
  for (Index k = 0; k < t; ++k) {
    const auto at = static_cast<std::size_t>(k);
    const inference::Reading& reading = plain.readings[at];
    unit[k] = reading.sd / readings.of_mean.readings[at].sd;
    const campaign::Experiment& experiment =
        campaign.experiments[static_cast<std::size_t>(reading.experiment)];
    const auto packings = static_cast<double>(experiment.specimens.size());
    const double share = campaign::ScatterShare(experiment);
    // A run departs less from the mean over R packings than from that over all, a new one more.
    scatter[k] = std::sqrt(
        readings.measured && packings > 1 ? (share + 1 / packings) / (1 - 1 / packings) : share);
  }
  const Eigen::MatrixXd noise =
      unit.asDiagonal() *
      Eigen::MatrixXd(Eigen::LLT<Eigen::MatrixXd>(NoiseCorrelation(plain)).matrixL());
  const Eigen::LLT<Eigen::MatrixXd> factor(response.run_covariance);
  response.model.draws.resize(kDraws, t);
  response.run_draws.resize(kDraws, t);
  Eigen::VectorXd normal(t);
  for (Index s = 0; s < kDraws; ++s) {
    inference::PhiloxStream stream({.seed = campaign.filter.seed,
                                    .purpose = inference::StreamPurpose::kDiagnosisDraws,
                                    .iteration = 0,
                                    .sample = static_cast<std::uint64_t>(s)});
    for (Index k = 0; k < t; ++k) normal[k] = stream.Normal();
    Eigen::VectorXd draw = noise * normal;
    for (const Eigen::VectorXd& direction : nuisance) draw += stream.Normal() * direction;
    const Index own = s % missed.rows();
    const double sign = stream.Normal() < 0 ? -1 : 1;
    draw += sign * scatter.cwiseProduct(missed.row(own).transpose());
    response.model.draws.row(s) = draw;
    // The fits take the closest of the runs about the right point.
    double closest = std::numeric_limits<double>::infinity();
    for (int k = 0; k < kRunsAbout; ++k) {
      const auto other =
          std::min(static_cast<Index>(stream.Uniform() * static_cast<double>(missed.rows())),
                   missed.rows() - 1);
      const Eigen::VectorXd difference = draw - missed.row(other).transpose();
      const double distance = factor.matrixL().solve(difference).squaredNorm();
      if (distance >= closest) continue;
      closest = distance;
      response.run_draws.row(s) = difference;
    }
  }
}

}  // namespace

RunTable RunsWithoutEffect(const RunTable& without, const campaign::Campaign& parent,
                           const campaign::Campaign& extended) {
  const auto d = static_cast<Index>(extended.parameters.size());
  std::vector<Index> from(static_cast<std::size_t>(d), -1);  // column of the parent
  std::vector<std::pair<Index, double>> nulls;
  for (Index j = 0; j < d; ++j) {
    const campaign::CalibratedParameter& own = extended.parameters[static_cast<std::size_t>(j)];
    for (std::size_t k = 0; k < parent.parameters.size(); ++k) {
      if (parent.parameters[k].name == own.name) {
        from[static_cast<std::size_t>(j)] = static_cast<Index>(k);
      }
    }
    if (from[static_cast<std::size_t>(j)] >= 0) continue;
    const dem::ParameterInfo* info = dem::FindParameter(
        extended.model.user_effects, extended.model.contact, extended.model.effects, own.name);
    const auto null =
        info == nullptr ? std::nullopt : dem::NullValueOf(*info, extended.model.contact);
    // A prior over orders of magnitude ends where the effect no longer matters.
    if (null) nulls.emplace_back(j, std::clamp(*null, own.prior.min, own.prior.max));
  }
  RunTable table;
  if (nulls.empty()) return table;
  const auto spread =
      inference::DrawSamples(inference::Proposal{}, campaign::Priors(extended), extended.filter, 0,
                             static_cast<int>(without.parameters.rows()));
  if (!spread.ok()) return table;
  table.parameters = *spread;
  table.histories = without.histories;
  table.sample = without.sample;
  for (Index i = 0; i < table.parameters.rows(); ++i) {
    for (Index j = 0; j < d; ++j) {
      const Index k = from[static_cast<std::size_t>(j)];
      if (k >= 0) table.parameters(i, j) = without.parameters(i, k);
    }
    const auto& [j, null] = nulls[static_cast<std::size_t>(i) % nulls.size()];
    table.parameters(i, j) = null;
  }
  return table;
}

absl::StatusOr<Response> RespondTo(const FittedCampaign& base,
                                   const std::vector<Eigen::VectorXd>& nuisance) {
  const report::CampaignView& view = base.view();
  const campaign::Campaign& campaign = view.campaign;
  const report::ScatteredReadings& readings = base.readings();
  const inference::DataSet& data = readings.of_mean;
  const inference::JointPrior priors = campaign::Priors(campaign);
  const RunTable& table = base.runs();
  const auto trained = inference::TrainEmulator(
      {.inputs = Standard(priors, table.parameters), .histories = table.histories}, data,
      {.scatter_share = readings.measured ? 0.0 : 1.0});
  if (!trained.ok()) {
    return absl::FailedPreconditionError(
        absl::StrCat("the runs of ", view.status.campaign(),
                     " cannot be emulated: ", trained.status().message()));
  }
  const inference::StateEmulator& emulator = trained->emulator;
  const inference::PrincipalComponents& components = emulator.components();
  const auto t = static_cast<Index>(data.readings.size());
  const auto d = static_cast<Index>(priors.size());

  Response response;
  response.emulator_error = emulator.cross_validation().rms;
  const double scatter = emulator.cross_validation().scatter_rms;
  response.trustworthy = std::sqrt(std::max(0.0, response.emulator_error * response.emulator_error -
                                                     scatter * scatter)) <= kMostUncovered;
  response.model.parameters = static_cast<int>(d);
  Eigen::MatrixXd points(0, d);
  Eigen::MatrixXd histories(0, t);
  Eigen::MatrixXd unknown(0, emulator.scatter_sd().size());
  const auto add = [&](const Eigen::MatrixXd& values) {
    const inference::ScorePrediction prediction = emulator.Predict(Standard(priors, values));
    std::vector<Index> known;
    for (Index i = 0; i < values.rows(); ++i) {
      if (prediction.sd.row(i).squaredNorm() <=
          kMostUnknown * kMostUnknown * static_cast<double>(t)) {
        known.push_back(i);
      }
    }
    const Index before = points.rows();
    const auto more = static_cast<Index>(known.size());
    points.conservativeResize(before + more, d);
    histories.conservativeResize(before + more, t);
    unknown.conservativeResize(before + more, unknown.cols());
    for (Index i = 0; i < more; ++i) {
      const Index from = known[static_cast<std::size_t>(i)];
      points.row(before + i) = values.row(from);
      unknown.row(before + i) = prediction.sd.row(from);
      histories.row(before + i) =
          components.mean + prediction.mean.row(from) * components.basis.transpose();
    }
  };
  const auto spread =
      inference::DrawSamples(inference::Proposal{}, priors, campaign.filter, 0, kSpread);
  if (!spread.ok()) return spread.status();
  add(*spread);
  add(table.parameters);
  if (const int n = view.posterior.draws_size() / std::max<int>(1, static_cast<int>(d)); n > 0) {
    Eigen::MatrixXd draws(n, d);
    for (Index i = 0; i < n; ++i) {
      for (Index j = 0; j < d; ++j) draws(i, j) = view.posterior.draws(static_cast<int>(i * d + j));
    }
    add(draws);
  }
  // Ever closer about the best point so far, so that the smallest misfit is met.
  double width = 0.2;
  for (int round = 0; round < kRounds && points.rows() > 0; ++round, width *= 0.4) {
    Index best = 0;
    histories.rowwise().squaredNorm().minCoeff(&best);
    inference::Proposal proposal;
    inference::MixtureComponent component{.weight = 1, .mean = {}, .covariance = {}};
    component.mean = Standard(priors, points.row(best)).transpose();
    component.covariance = width * width * Eigen::MatrixXd::Identity(d, d);
    proposal.components.push_back(component);
    proposal.log_acceptance = inference::LogMassInSupport(proposal.components, priors);
    const auto refined =
        inference::DrawSamples(proposal, priors, campaign.filter, 1000 + round, kRefined);
    if (!refined.ok()) break;  // next to no mass inside the prior: the corner is the best point
    add(*refined);
  }
  if (points.rows() == 0) {
    return absl::FailedPreconditionError("the emulator knows no point of the prior well enough");
  }
  // What is not known of the mean history at the best point, and the scatter of a measurement.
  Index best = 0;
  histories.rowwise().squaredNorm().minCoeff(&best);
  // Of a history, from standard deviations of its scores.
  const auto covariance_of = [&](const Eigen::VectorXd& sd) -> Eigen::MatrixXd {
    const Eigen::MatrixXd factor = components.basis * sd.asDiagonal();
    Eigen::MatrixXd covariance = factor * emulator.correlation() * factor.transpose();
    covariance.diagonal() += components.remainder;
    return covariance;
  };
  Eigen::MatrixXd numerical = Eigen::MatrixXd::Zero(t, t);
  for (const Eigen::VectorXd& direction : nuisance) {
    numerical += direction * direction.transpose();
  }
  const Eigen::VectorXd not_known = unknown.row(best).transpose();
  if (readings.measured) {
    Eigen::VectorXd unit(t);  // sd of one run's difference over that of the mean history's
    double square = 0;
    const inference::DataSet plain = campaign::MakeDataSet(campaign);
    for (Index k = 0; k < t; ++k) {
      const auto at = static_cast<std::size_t>(k);
      unit[k] = readings.of_run.readings[at].sd / data.readings[at].sd;
      const double of_mean = data.readings[at].sd / plain.readings[at].sd;
      square += (unit[k] * unit[k] - 1) * of_mean * of_mean;
    }
    response.scatter = std::sqrt(square / static_cast<double>(t));
    response.model.covariance = NoiseCorrelation(data) + numerical + covariance_of(not_known);
    response.run_covariance =
        unit.asDiagonal() * NoiseCorrelation(readings.of_run) * unit.asDiagonal();
    response.run_covariance += numerical;
  } else {
    const Eigen::VectorXd& sd = emulator.scatter_sd();
    response.scatter = scatter;
    const Eigen::MatrixXd noise = NoiseCorrelation(data) + numerical;
    response.model.covariance =
        noise + covariance_of((not_known.array().square() + sd.array().square()).sqrt());
    response.run_covariance = noise + 2 * covariance_of(sd);
  }
  // As large near the best point as elsewhere: far out the emulator knows less, which is no
  // scatter.
  const Eigen::VectorXd missed =
      covariance_of((not_known.array().square() + emulator.scatter_sd().array().square()).sqrt())
          .diagonal()
          .cwiseSqrt();
  DrawMeasurements(base, emulator.cross_validation().standardised * missed.asDiagonal(), nuisance,
                   response);
  response.model.histories = std::move(histories);
  response.points = std::move(points);
  response.parts = PartsOf(campaign, data);
  return response;
}

}  // namespace calib::ctl
