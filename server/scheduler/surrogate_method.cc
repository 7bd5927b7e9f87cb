// surrogate_msrs: a symmetric Latin hypercube, then rounds of points chosen on a response surface
// of the misfit. Rounds are of one size, whatever the number of workers, so that the same points
// are chosen everywhere.

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "inference/surrogate/expected_improvement.h"
#include "inference/surrogate/response_surface.h"
#include "server/scheduler/method.h"
#include "server/scheduler/posterior_record.h"

namespace calib::scheduler {
namespace {

using Json = nlohmann::json;

constexpr const char* kUnitPoints = "unit_points";

/// A point of the unit cube in the parameters' units, through the prior's quantiles. A face is the
/// prior's bound; where there is none, its outermost 1e-4. Correlated priors have no faces of their
/// own and end there.
Eigen::VectorXd FromUnit(const inference::JointPrior& priors, const Eigen::VectorXd& u) {
  constexpr double kOutermost = 1e-4;
  const Eigen::VectorXd inside = u.array().max(kOutermost).min(1 - kOutermost);
  Eigen::VectorXd x = priors.FromUnit(inside);
  for (Eigen::Index j = 0; priors.is_independent() && j < u.size(); ++j) {
    const inference::Prior& prior = priors[static_cast<std::size_t>(j)];
    if (u(j) <= 0 && std::isfinite(prior.min)) {
      x(j) = prior.min;
    }
    if (u(j) >= 1 && std::isfinite(prior.max)) {
      x(j) = prior.max;
    }
  }
  return x;
}

class SurrogateMethod final : public Method {
 public:
  explicit SurrogateMethod(const Definition& definition)
      : definition_(definition), campaign_(definition.campaign) {
    options_.dimensions = static_cast<int>(definition.priors.size());
    options_.initial_points = campaign_.samples;
    options_.max_evaluations = MostEvaluations();
    options_.workers = campaign::LaterBatch(campaign_);
    options_.seed = campaign_.seed;
    options_.termination = campaign_.termination.value_or(options_.termination);
    if (definition.priors.is_constrained()) {
      options_.admissible = [&definition](const Eigen::VectorXd& u) {
        return definition.priors.MeetsConstraints(FromUnit(definition.priors, u));
      };
    }
  }

  absl::StatusOr<Batch> First() const override {
    auto state = inference::StartResponseSurface(options_);
    if (!state.ok()) {
      return state.status();
    }
    return MakeBatch(state->design, *state);
  }

  absl::StatusOr<Outcome> Conclude(const History& history, bool affordable) const override {
    const auto misfits = Misfits(history);
    if (!misfits.ok()) {
      return misfits.status();
    }
    auto state = Rebuild(history, *misfits);
    if (!state.ok()) {
      return state.status();
    }
    if (state->best < 0) {
      return absl::FailedPreconditionError(
          "every run so far has diverged, so that there is nothing to fit: look at the reasons of "
          "the samples, then narrow the priors or change the model");
    }
    Outcome outcome{.answer = AnswerOf(history, *state), .converged = false, .log = "", .next = {}};
    outcome.log = absl::StrCat("best chi-squared per reading ",
                               state->evaluations[static_cast<std::size_t>(state->best)].value,
                               ", step ", state->step);
    const absl::StatusOr<Eigen::MatrixXd> chosen =
        affordable ? ChoosePoints(*state) : Eigen::MatrixXd{};
    if (!chosen.ok()) {
      return chosen.status();
    }
    const Eigen::MatrixXd& points = *chosen;
    if (points.rows() > 0) {
      outcome.answer.warnings.push_back(outcome.answer.weighted.degeneracy);
      auto batch = MakeBatch(points, *state);
      if (!batch.ok()) {
        return batch.status();
      }
      outcome.next = *std::move(batch);
    } else {
      AskEmulator(definition_, history.iterations, outcome.answer);
      outcome.converged = outcome.answer.FromEmulator();
    }
    return outcome;
  }

 private:
  int MostEvaluations() const {
    const auto most = static_cast<std::int64_t>(campaign_.samples) * campaign_.max_iterations;
    return static_cast<int>(std::min<std::int64_t>(most, std::numeric_limits<int>::max()));
  }

  /// Points of the state; each may be stopped by what is the best now, however the others of its
  /// round end, so that the same runs are stopped everywhere.
  absl::StatusOr<Batch> MakeBatch(const Eigen::MatrixXd& unit,
                                  const inference::ResponseSurfaceState& state) const {
    Json rows = Json::array();
    Batch batch;
    batch.parameters.resize(unit.rows(), unit.cols());
    for (Eigen::Index i = 0; i < unit.rows(); ++i) {
      const Eigen::VectorXd row = unit.row(i);
      rows.push_back(std::vector<double>(row.begin(), row.end()));
      batch.parameters.row(i) = FromUnit(definition_.priors, row);
    }
    batch.proposal = Json{{kUnitPoints, rows}}.dump();
    batch.stop_below.assign(static_cast<std::size_t>(unit.rows()), store::kUnknown);
    // A tempered likelihood has no bound that could be kept.
    if (!campaign_.termination || campaign_.filter.noise == inference::NoiseMode::kEssTarget) {
      return batch;
    }
    const auto perfect = Perfect();
    if (!perfect.ok()) {
      return perfect.status();
    }
    const int first =
        static_cast<int>(state.evaluations.size()) - static_cast<int>(batch.stop_below.size());
    for (std::size_t i = 0; i < batch.stop_below.size(); ++i) {
      const double bound =
          inference::TerminationBound(options_, first + static_cast<int>(i), state);
      if (std::isfinite(bound)) {
        batch.stop_below[i] = *perfect - bound * Readings() / 2;
      }
    }
    return batch;
  }

  double Readings() const { return static_cast<double>(definition_.data.readings.size()); }

  /// ln likelihood of a run that agrees with every reading.
  absl::StatusOr<double> Perfect() const {
    const auto perfect = inference::LogLikelihoodBound(
        definition_.data, campaign_.filter,
        Eigen::MatrixXd::Constant(1, static_cast<Eigen::Index>(definition_.data.readings.size()),
                                  kNone));
    if (!perfect.ok()) {
      return perfect.status();
    }
    return (*perfect)(0);
  }

  /// Chi-squared per reading of every sample: twice what its log likelihood lacks to that of
  /// perfect agreement; NaN: diverged or ended early.
  absl::StatusOr<std::vector<Eigen::VectorXd>> Misfits(const History& history) const {
    const auto perfect = Perfect();
    auto batches = LogLikelihoodsByBatch(definition_, history);
    if (!perfect.ok() || !batches.ok()) {
      return perfect.ok() ? batches.status() : perfect.status();
    }
    for (Eigen::VectorXd& values : *batches) {
      values = values.unaryExpr([&](double value) {
        return std::isfinite(value) ? 2 * (*perfect - value) / Readings() : kNone;
      });
    }
    return batches;
  }

  /// The optimiser as it was after everything in the history, results reported round by round in
  /// order.
  absl::StatusOr<inference::ResponseSurfaceState> Rebuild(
      const History& history, const std::vector<Eigen::VectorXd>& misfits) const {
    inference::ResponseSurfaceState state;
    state.step = options_.max_step;
    for (std::size_t k = 0; k < misfits.size(); ++k) {
      const auto points = UnitPoints(history.proposals[k]);
      if (!points.ok()) {
        return points.status();
      }
      if (points->rows() != misfits[k].size()) {
        return absl::DataLossError(absl::StrCat("batch ", k, " has ", misfits[k].size(),
                                                " samples but ", points->rows(), " points"));
      }
      if (k == 0) {
        state.design = *points;
      }
      const auto first = static_cast<int>(state.evaluations.size());
      for (Eigen::Index i = 0; i < points->rows(); ++i) {
        state.evaluations.push_back({.point = points->row(i)});
      }
      for (Eigen::Index i = 0; i < points->rows(); ++i) {
        const double value = misfits[k](i);
        if (auto status = inference::Report(
                options_, first + static_cast<int>(i),
                std::isfinite(value) ? std::optional<double>(value) : std::nullopt, state);
            !status.ok()) {
          return status;
        }
      }
    }
    return state;
  }

  absl::StatusOr<Eigen::MatrixXd> UnitPoints(const std::string& proposal) const {
    try {
      const auto rows =
          Json::parse(proposal).at(kUnitPoints).get<std::vector<std::vector<double>>>();
      Eigen::MatrixXd points(static_cast<Eigen::Index>(rows.size()), options_.dimensions);
      for (std::size_t i = 0; i < rows.size(); ++i) {
        if (rows[i].size() != static_cast<std::size_t>(options_.dimensions)) {
          return absl::DataLossError("a stored point has the wrong number of coordinates");
        }
        points.row(static_cast<Eigen::Index>(i)) =
            Eigen::Map<const Eigen::RowVectorXd>(rows[i].data(), points.cols());
      }
      return points;
    } catch (const Json::exception& error) {
      return absl::DataLossError(absl::StrCat("stored points: ", error.what()));
    }
  }

  /// The next round; no rows: the budget is used up, or too few runs have a value.
  absl::StatusOr<Eigen::MatrixXd> ChoosePoints(inference::ResponseSurfaceState& state) const {
    inference::CubicRbf surrogate(options_.dimensions);
    std::vector<Eigen::VectorXd> chosen;
    while (static_cast<int>(chosen.size()) < campaign::LaterBatch(campaign_)) {
      absl::StatusOr<std::optional<Eigen::VectorXd>> point =
          campaign_.surrogate == campaign::SurrogateModel::kGaussianProcess
              ? inference::NextByExpectedImprovement(options_, state)
              : inference::NextPoint(options_, state, surrogate);
      if (!point.ok()) {
        return point.status();
      }
      if (!point->has_value()) {
        break;
      }
      chosen.push_back(**point);
    }
    Eigen::MatrixXd points(static_cast<Eigen::Index>(chosen.size()), options_.dimensions);
    for (std::size_t i = 0; i < chosen.size(); ++i) {
      points.row(static_cast<Eigen::Index>(i)) = chosen[i];
    }
    return points;
  }

  /// The best run, and no posterior.
  Answer AnswerOf(const History& history, const inference::ResponseSurfaceState& state) const {
    Answer answer;
    inference::Posterior& posterior = answer.weighted;
    posterior.log_weights =
        Eigen::VectorXd::Constant(static_cast<Eigen::Index>(history.samples.size()),
                                  -std::numeric_limits<double>::infinity());
    posterior.log_weights(state.best) = 0;
    const auto& best = history.samples[static_cast<std::size_t>(state.best)].parameters;
    for (const double value : best) {
      posterior.parameters.push_back(
          {.mean = value, .sd = kNone, .cov = kNone, .q05 = kNone, .q50 = kNone, .q95 = kNone});
    }
    posterior.log_evidence = posterior.log_evidence_se = posterior.pareto_k = kNone;
    posterior.ess = 1;
    posterior.degeneracy =
        "An optimiser looks for the best fit and gives no posterior: the values stand for the best "
        "run.";
    return answer;
  }

  const Definition& definition_;
  const campaign::Campaign& campaign_;
  inference::ResponseSurfaceOptions options_;
};

}  // namespace

std::unique_ptr<Method> MakeSurrogateMethod(const Definition& definition) {
  return std::make_unique<SurrogateMethod>(definition);
}

}  // namespace calib::scheduler
