#include "server/diagnosis/response.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/emulator/training_set.h"
#include "inference/filter/iterative_filter.h"
#include "inference/numerics/decompositions.h"
#include "server/diagnosis/left_out_packings.h"
#include "server/diagnosis/stage_shapes.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;
using report::RunTable;

constexpr int kSpread = 3000;   // points over the prior
constexpr int kRefined = 1000;  // about the best of them, in each round
constexpr int kRounds = 4;
// Of an emulator to judge by, noise sd: its error beyond the scatter of single runs.
constexpr double kMostUncovered = 2;

Eigen::MatrixXd Standard(const inference::JointPrior& priors, const Eigen::MatrixXd& values) {
  Eigen::MatrixXd standard(values.rows(), values.cols());
  for (Index j = 0; j < values.cols(); ++j) {
    for (Index i = 0; i < values.rows(); ++i) {
      standard(i, j) = priors[static_cast<std::size_t>(j)].ToStandard(values(i, j));
    }
  }
  return standard;
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

// Of some of the runs: those that share a packing in any experiment have the same number.
std::vector<int> PackingsOf(const campaign::Campaign& campaign, const RunTable& runs,
                            const std::vector<Index>& rows) {
  const int packings = PackingsApart(campaign);
  std::vector<int> packing;
  packing.reserve(rows.size());
  for (const Index row : rows) {
    packing.push_back(runs.stream[static_cast<std::size_t>(row)] % packings);
  }
  return packing;
}

// Of the posterior: n x d, SI.
Eigen::MatrixXd DrawsOf(const report::CampaignView& view) {
  const v1::Posterior& posterior = view.posterior;
  const auto d = static_cast<Index>(view.campaign.parameters.size());
  const Index n = posterior.draws_size() / std::max<Index>(1, d);
  Eigen::MatrixXd draws(n, d);
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < d; ++j) draws(i, j) = posterior.draws(static_cast<int>(i * d + j));
  }
  return draws;
}

}  // namespace

absl::StatusOr<Response> RespondTo(const FittedCampaign& base, const report::CampaignView& view,
                                   const std::vector<Eigen::VectorXd>& nuisance) {
  return RespondTo(base,
                   {.campaign = view.campaign,
                    .runs = report::RunsOf(view, base.readings().of_mean),
                    .draws = DrawsOf(view)},
                   nuisance);
}

absl::StatusOr<Response> RespondTo(const FittedCampaign& base,
                                   const std::vector<Eigen::VectorXd>& nuisance) {
  auto response = RespondTo(
      base, {.campaign = base.view().campaign, .runs = base.runs(), .draws = DrawsOf(base.view())},
      nuisance);
  if (response.ok()) {
    response->model.shapes = StageShapes(base.view().campaign, base.readings().of_mean);
  }
  return response;
}

absl::StatusOr<Response> RespondTo(const FittedCampaign& base, const EmulatedModel& model,
                                   const std::vector<Eigen::VectorXd>& nuisance) {
  const campaign::Campaign& campaign = model.campaign;
  const report::ScatteredReadings& readings = base.readings();
  const inference::DataSet& data = readings.of_mean;
  const inference::JointPrior priors = campaign::Priors(campaign);
  const RunTable& table = model.runs;
  const auto trained = inference::TrainEmulator(
      {.inputs = Standard(priors, table.parameters), .histories = table.histories}, data,
      {.scatter_share = readings.measured ? 0.0 : 1.0});
  if (!trained.ok()) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the runs of ", base.id(), " cannot be emulated: ", trained.status().message()));
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
  // A history is the mean and as much of each component as its scores say.
  const Index q = components.basis.cols();
  Eigen::MatrixXd shapes(t, 1 + q);
  shapes << components.mean.transpose(), components.basis;
  Eigen::MatrixXd points(0, d);
  Eigen::MatrixXd coefficients(1 + q, 0);
  Eigen::MatrixXd unknown(0, q);
  const auto add = [&](const Eigen::MatrixXd& values) {
    const inference::ScorePrediction prediction = emulator.Predict(Standard(priors, values));
    std::vector<Index> known;
    for (Index i = 0; i < values.rows(); ++i) {
      if (prediction.sd.row(i).squaredNorm() <=
          model.most_unknown * model.most_unknown * static_cast<double>(t)) {
        known.push_back(i);
      }
    }
    const Index before = points.rows();
    const auto more = static_cast<Index>(known.size());
    points.conservativeResize(before + more, d);
    coefficients.conservativeResize(1 + q, before + more);
    unknown.conservativeResize(before + more, unknown.cols());
    for (Index i = 0; i < more; ++i) {
      const Index from = known[static_cast<std::size_t>(i)];
      points.row(before + i) = values.row(from);
      unknown.row(before + i) = prediction.sd.row(from);
      coefficients.col(before + i) << 1, prediction.mean.row(from).transpose();
    }
  };
  ASSIGN_OR_RETURN(const auto spread, inference::DrawSamples(inference::Proposal{}, priors,
                                                             campaign.filter, 0, kSpread));
  add(spread);
  add(table.parameters);
  if (model.draws.rows() > 0) add(model.draws);
  if (points.rows() == 0) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the emulator of the runs of ", base.id(),
        " knows the model nowhere as well as a judgement needs it (to ", model.most_unknown,
        " sd of a measurement): run more samples, or see whether the stated errors are too small"));
  }
  const std::vector<int> packing = PackingsOf(base.view().campaign, table, trained->relevant);
  const auto errors_at = [&](Index point) {
    return ErrorsOfMeasurements(base, emulator, unknown.row(point), packing, nuisance);
  };
  Index best = 0;
  (shapes * coefficients).colwise().squaredNorm().minCoeff(&best);
  const Eigen::LLT<Eigen::MatrixXd> factor(errors_at(best).of_mean.covariance);
  const Eigen::MatrixXd whitened = factor.matrixL().solve(shapes);
  Eigen::VectorXd misfit;
  // Ever closer about the best point so far, so that the smallest misfit is met.
  double width = 0.2;
  for (int round = 0;; ++round, width *= 0.4) {
    const Index before = misfit.size();
    const Index more = coefficients.cols() - before;
    misfit.conservativeResize(coefficients.cols());
    misfit.tail(more) = (whitened * coefficients.rightCols(more)).colwise().squaredNorm();
    misfit.minCoeff(&best);
    if (round == kRounds) break;
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
  MeasurementErrors errors = errors_at(best);
  response.scatter = errors.scatter;
  response.model.packings = errors.packings;
  response.model.covariance = std::move(errors.of_mean.covariance);
  response.model.draws = std::move(errors.of_mean.draws);
  response.model.group = std::move(errors.of_mean.group);
  response.model.without = std::move(errors.of_mean.without);
  response.of_run = std::move(errors.of_run);
  response.model.histories = {std::move(shapes), std::move(coefficients)};
  response.points = std::move(points);
  response.parts = PartsOf(base.view().campaign, data);
  response.nuisance = nuisance;
  return response;
}

}  // namespace calib::diagnosis
