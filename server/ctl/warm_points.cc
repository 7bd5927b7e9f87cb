#include "server/ctl/warm_points.h"

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <limits>
#include <numeric>

#include "absl/strings/str_cat.h"
#include "inference/surrogate/response_surface.h"

namespace calib::ctl {
namespace {

using Eigen::Index;

constexpr int kDraws = 1000;             // of the emulated posterior
constexpr std::size_t kMostKnown = 150;  // runs the response surface goes through, the best of all

// As the inference sees runs: predictions in the units of the readings.
inference::Iteration IterationOf(const report::RunTable& runs, const inference::DataSet& data) {
  inference::Iteration iteration;
  iteration.parameters = runs.parameters;
  iteration.predictions = runs.histories;
  for (Index k = 0; k < runs.histories.cols(); ++k) {
    const inference::Reading& reading = data.readings[static_cast<std::size_t>(k)];
    iteration.predictions.col(k) =
        (runs.histories.col(k).array() * reading.sd + reading.value).matrix();
  }
  return iteration;
}

// Into the unit cube by the marginals, and back.
double ToUnit(const inference::Prior& prior, double x) {
  const double score = prior.NormalScore(x);
  if (!std::isfinite(score)) return score > 0 ? 1 : 0;
  return boost::math::cdf(boost::math::normal(), score);
}
double FromUnit(const inference::Prior& prior, double u) {
  constexpr double kEdge = 1e-9;
  return prior.Quantile(std::clamp(u, kEdge, 1 - kEdge));
}

Eigen::VectorXd FromCube(const inference::JointPrior& priors, const Eigen::VectorXd& u) {
  Eigen::VectorXd x(u.size());
  for (Index j = 0; j < u.size(); ++j) x(j) = FromUnit(priors[static_cast<std::size_t>(j)], u(j));
  return x;
}

absl::StatusOr<Eigen::MatrixXd> StepsFromTheBest(const inference::JointPrior& priors,
                                                 const report::RunTable& runs,
                                                 const Eigen::VectorXd& chi2, std::uint64_t seed,
                                                 int count) {
  const auto d = static_cast<Index>(priors.size());
  std::vector<Index> order(static_cast<std::size_t>(chi2.size()));
  std::iota(order.begin(), order.end(), Index{0});
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return chi2(a) < chi2(b); });
  order.resize(std::min(order.size(), kMostKnown));
  inference::ResponseSurfaceState state;
  state.design.resize(0, d);
  for (const Index i : order) {
    inference::Evaluation evaluation{.point = Eigen::VectorXd(d),
                                     .status = inference::EvaluationStatus::kDone,
                                     .value = std::log(chi2(i))};
    for (Index j = 0; j < d; ++j) {
      evaluation.point(j) = ToUnit(priors[static_cast<std::size_t>(j)], runs.parameters(i, j));
    }
    state.completed.push_back(static_cast<int>(state.evaluations.size()));
    state.evaluations.push_back(std::move(evaluation));
  }
  state.best = 0;
  inference::ResponseSurfaceOptions options{.dimensions = static_cast<int>(d)};
  options.max_evaluations = static_cast<int>(state.evaluations.size()) + count;
  options.seed = seed;
  options.admissible = [&priors](const Eigen::VectorXd& u) {
    return priors.MeetsConstraints(FromCube(priors, u));
  };
  state.step = options.max_step;
  inference::CubicRbf surrogate(static_cast<int>(d));
  Eigen::MatrixXd points(count, d);
  for (int i = 0; i < count; ++i) {
    const auto point = inference::NextPoint(options, state, surrogate);
    if (!point) return absl::FailedPreconditionError("too few runs to go on from");
    points.row(i) = FromCube(priors, *point).transpose();
  }
  return points;
}

}  // namespace

void Append(const report::RunTable& more, report::RunTable& runs) {
  const Index before = runs.histories.rows();
  const Index n = more.histories.rows();
  if (n == 0) return;
  runs.parameters.conservativeResize(before + n, more.parameters.cols());
  runs.histories.conservativeResize(before + n, more.histories.cols());
  runs.parameters.bottomRows(n) = more.parameters;
  runs.histories.bottomRows(n) = more.histories;
  runs.sample.insert(runs.sample.end(), more.sample.begin(), more.sample.end());
}

report::RunTable RunsOfScreen(const std::vector<EffectScreen::EffectRun>& runs,
                              const campaign::Campaign& extended) {
  report::RunTable table;
  for (const EffectScreen::EffectRun& run : runs) {
    Eigen::RowVectorXd point(static_cast<Index>(extended.parameters.size()));
    bool known = true;
    for (Index j = 0; j < point.size(); ++j) {
      const campaign::CalibratedParameter& parameter =
          extended.parameters[static_cast<std::size_t>(j)];
      const auto value = run.values.find(parameter.name);
      known = known && value != run.values.end() && parameter.prior.InSupport(value->second);
      if (known) point(j) = value->second;
    }
    if (!known) continue;
    report::RunTable one;
    one.parameters = point;
    one.histories = run.history.transpose();
    Append(one, table);
  }
  return table;
}

absl::StatusOr<inference::EmulatedResult> Emulate(const campaign::Campaign& campaign,
                                                  const report::RunTable& runs) {
  const inference::JointPrior priors = campaign::Priors(campaign);
  const inference::DataSet data = campaign::MakeDataSet(campaign);
  inference::EmulatorOptions options{.training = {}, .draws = kDraws, .seed = campaign.filter.seed};
  options.training.relevant_runs = std::max<int>(20, static_cast<int>(5 * priors.size()));
  const std::vector<inference::Iteration> iterations = {IterationOf(runs, data)};
  return inference::EmulatedPosterior(priors, data, options, iterations);
}

absl::StatusOr<Eigen::MatrixXd> NextPoints(const campaign::Campaign& campaign,
                                           const report::RunTable& runs,
                                           const Eigen::VectorXd& chi2, Index with_effect,
                                           int batch, int count) {
  const inference::JointPrior priors = campaign::Priors(campaign);
  const auto emulated = Emulate(campaign, runs);
  if (emulated.ok() && emulated->draws.rows() > 0) {
    const auto proposal = inference::FitProposalToDraws(priors, campaign.filter, emulated->draws,
                                                        static_cast<std::size_t>(batch));
    if (!proposal.ok()) return proposal.status();
    return inference::DrawSamples(*proposal, priors, campaign.filter, batch, count);
  }
  if (with_effect < static_cast<Index>(2 * priors.size() + 1)) {
    return inference::DrawSamples(inference::Proposal{}, priors, campaign.filter, batch, count);
  }
  return StepsFromTheBest(priors, runs, chi2.head(with_effect),
                          campaign.filter.seed + static_cast<std::uint64_t>(batch), count);
}

}  // namespace calib::ctl
