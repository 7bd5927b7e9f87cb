#include "server/methods/surrogate_msrs/surrogate_planner.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/numerics/decompositions.h"
#include "inference/numerics/standard_normal.h"
#include "inference/surrogate/cubic_rbf.h"
#include "inference/surrogate/expected_improvement.h"
#include "inference/surrogate/response_surface.h"
#include "server/planning/plan_memory.h"
#include "server/planning/posterior_record.h"

namespace calib::methods {
namespace {

using Json = nlohmann::json;

constexpr const char* kUnitPoints = "unit_points";
constexpr const char* kBestRun = "The values stand for the best run.";

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

/// The point of the unit cube that FromUnit() takes to x, which lies in the support of the priors.
Eigen::VectorXd ToUnit(const inference::JointPrior& priors, const Eigen::VectorXd& x) {
  constexpr double kFarthest = 8.2;  // Phi^-1(1 - 1e-16); a bound itself has an infinite score
  Eigen::VectorXd z(x.size());
  for (Eigen::Index j = 0; j < x.size(); ++j) {
    z(j) = priors[static_cast<std::size_t>(j)].NormalScore(x(j));
  }
  if (!priors.is_independent()) {
    z = z.cwiseMax(-kFarthest).cwiseMin(kFarthest).eval();
    priors.correlation().llt().matrixL().solveInPlace(z);
  }
  return z.unaryExpr([](double score) { return std::exp(inference::LogNormalCdf(score)); });
}

struct SurfaceSoFar final : planning::PlannerMemory {
  std::optional<inference::CubicRbf> interpolant;
};

class SurrogatePlanner final : public planning::Planner {
 public:
  SurrogatePlanner(const planning::Definition& definition, const SurrogateOptions& own)
      : definition_(definition), campaign_(definition.campaign), own_(own) {
    options_.dimensions = static_cast<int>(definition.priors.size());
    options_.initial_points = campaign_.samples;
    options_.max_evaluations = MostEvaluations();
    options_.workers = own_.in_flight;
    options_.seed = campaign_.seed;
    options_.termination = own_.termination.value_or(options_.termination);
    if (definition.priors.is_constrained()) {
      options_.admissible = [&definition](const Eigen::VectorXd& u) {
        return definition.priors.MeetsConstraints(FromUnit(definition.priors, u));
      };
    }
  }

  absl::StatusOr<planning::Batch> First() const override {
    ASSIGN_OR_RETURN(auto first, FirstPoints());
    inference::ResponseSurfaceOptions options = options_;
    options.first_points = std::move(first);
    ASSIGN_OR_RETURN(auto state, inference::StartResponseSurface(options));
    return MakeBatch(
        state.design, 0,
        std::vector<double>(static_cast<std::size_t>(state.design.rows()), store::kUnknown));
  }

  absl::StatusOr<planning::Outcome> Conclude(const planning::History& history,
                                             bool goes_on) const override {
    const auto results = Results(history);
    ASSIGN_OR_RETURN(auto state, Known(history, results, true));
    if (state.best < 0) {
      return absl::FailedPreconditionError(
          "every run so far has diverged, so that there is nothing to fit: look at the reasons of "
          "the samples, then narrow the priors or change the model");
    }
    planning::Outcome outcome{
        .answer = AnswerOf(history, state), .converged = false, .log = "", .next = {}};
    outcome.log = absl::StrCat("best chi-squared per reading ",
                               state.evaluations[static_cast<std::size_t>(state.best)].value,
                               ", step ", state.step);
    if (goes_on) {
      outcome.answer.warnings.push_back(outcome.answer.weighted.degeneracy);
      outcome.answer.warnings.emplace_back(kBestRun);
    } else {
      planning::AskEmulator(definition_, history.iterations, outcome.answer);
      if (!outcome.answer.FromEmulator()) outcome.answer.warnings.emplace_back(kBestRun);
      outcome.converged = outcome.answer.FromEmulator() && HalvesGiveOne(outcome.answer);
    }
    return outcome;
  }

  absl::StatusOr<planning::Batch> More(const planning::History& history,
                                       std::int64_t affordable) const override {
    const bool at_once = campaign_.decisions == campaign::Decisions::kImmediate;
    const auto results = Results(history);
    ASSIGN_OR_RETURN(auto state, Known(history, results, at_once));
    const Eigen::Index size = campaign_.method->LaterBatch(campaign_);
    const Eigen::Index last = history.iterations.back().parameters.rows();
    const bool continues = history.iterations.size() > 1 && last < size;
    const std::int64_t most = std::min<std::int64_t>(affordable, continues ? size - last : size);
    std::size_t reported = 0;
    std::vector<double> stop_below;
    while (static_cast<std::int64_t>(stop_below.size()) < most) {
      ASSIGN_OR_RETURN(const auto point,
                       at_once ? NextAtOnce(state) : NextInOrder(*results, reported, state));
      if (!point.has_value()) {
        break;
      }
      ASSIGN_OR_RETURN(const auto threshold,
                       StopBelow(static_cast<int>(state.evaluations.size()) - 1, state));
      stop_below.push_back(threshold);
    }
    if (stop_below.empty()) {
      return planning::Batch{};
    }
    const Eigen::Index there = continues ? last : 0;
    Eigen::MatrixXd unit(there + static_cast<Eigen::Index>(stop_below.size()), options_.dimensions);
    const std::size_t first = state.evaluations.size() - static_cast<std::size_t>(unit.rows());
    for (Eigen::Index i = 0; i < unit.rows(); ++i) {
      unit.row(i) = state.evaluations[first + static_cast<std::size_t>(i)].point;
    }
    return MakeBatch(unit, there, std::move(stop_below));
  }

  absl::StatusOr<std::vector<std::pair<int, double>>> Thresholds(
      const planning::History& history) const override {
    const auto results = Results(history);
    ASSIGN_OR_RETURN(auto state, Known(history, results, true));
    std::vector<std::pair<int, double>> changed;
    for (std::size_t i = 0; i < results->size(); ++i) {
      const store::SampleRecord& sample = history.samples[i];
      ASSIGN_OR_RETURN(const auto threshold, StopBelow(static_cast<int>(i), state));
      // NaN, never stopped, equals nothing.
      if (!(*results)[i].ended && !std::isnan(threshold) && threshold != sample.stop_below) {
        changed.emplace_back(sample.sample, threshold);
      }
    }
    return changed;
  }

 private:
  using State = inference::ResponseSurfaceState;
  using Point = std::optional<Eigen::VectorXd>;

  /// Of one point.
  struct Result {
    bool ended = false;
    std::optional<double> value{};     ///< chi-squared per reading; empty: none, or not yet
    std::optional<double> at_least{};  ///< what it would have been at least, of one stopped early
  };

  /// An emulator of few runs may be adequate by its own account where half of them give no
  /// posterior at all: nothing then says how far the other half has settled it.
  static bool HalvesGiveOne(const planning::Answer& answer) {
    return answer.emulated->split_half.array().isFinite().any();
  }

  int MostEvaluations() const {
    const auto most = static_cast<std::int64_t>(campaign_.samples) * campaign_.max_iterations;
    return static_cast<int>(std::min<std::int64_t>(most, std::numeric_limits<int>::max()));
  }

  /// The share of the design that the first proposal does not leave to the prior: its centre, which
  /// is a run that is known to come close where there is one, and draws. None where it names no
  /// parameter; two points at least stay of the hypercube, which is none with fewer.
  absl::StatusOr<Eigen::MatrixXd> FirstPoints() const {
    constexpr int kFewest = 2;
    inference::Proposal proposal = campaign::FirstProposalOf(campaign_);
    const auto spread = static_cast<int>(std::lround(proposal.defensive_share * campaign_.samples));
    const int points = campaign_.samples - std::max(kFewest, spread);
    if (!campaign_.first_proposal || campaign_.first_proposal->places.empty() || points < 1) {
      return Eigen::MatrixXd{};
    }
    proposal.defensive_share = 0;
    auto drawn = inference::DrawSamples(proposal, definition_.priors, campaign_.filter, 0, points);
    if (!drawn.ok()) {
      return drawn;
    }
    if (const Eigen::VectorXd center = Center(); definition_.priors.InSupport(center)) {
      drawn->row(0) = center;
    }
    Eigen::MatrixXd unit(drawn->rows(), drawn->cols());
    for (Eigen::Index i = 0; i < unit.rows(); ++i) {
      unit.row(i) = ToUnit(definition_.priors, drawn->row(i));
    }
    return unit;
  }

  /// Of the first proposal; of parameters that it does not name, their prior's.
  Eigen::VectorXd Center() const {
    Eigen::VectorXd center(options_.dimensions);
    for (std::size_t j = 0; j < campaign_.parameters.size(); ++j) {
      const auto& places = campaign_.first_proposal->places;
      const auto place = places.find(campaign_.parameters[j].name);
      center(static_cast<Eigen::Index>(j)) =
          place != places.end() ? place->second.center : definition_.priors[j].FromStandard(0);
    }
    return center;
  }

  /// unit: all points of the iteration; those from row `there` on are new.
  planning::Batch MakeBatch(const Eigen::MatrixXd& unit, Eigen::Index there,
                            std::vector<double> stop_below) const {
    Json rows = Json::array();
    planning::Batch batch;
    batch.parameters.resize(unit.rows() - there, unit.cols());
    for (Eigen::Index i = 0; i < unit.rows(); ++i) {
      const Eigen::VectorXd row = unit.row(i);
      rows.push_back(std::vector<double>(row.begin(), row.end()));
      if (i >= there) {
        batch.parameters.row(i - there) = FromUnit(definition_.priors, row);
      }
    }
    batch.proposal = Json{{kUnitPoints, rows}}.dump();
    batch.stop_below = std::move(stop_below);
    batch.continues = there > 0;
    return batch;
  }

  /// Where a run of this point ends by what the state knows; NaN: it never does. A tempered
  /// likelihood has no bound that could be kept.
  absl::StatusOr<double> StopBelow(int id, const State& state) const {
    if (!own_.termination || campaign_.filter.noise == inference::NoiseMode::kEssTarget) {
      return store::kUnknown;
    }
    const auto perfect = Perfect();
    const double bound = inference::TerminationBound(options_, id, state);
    if (!perfect.ok() || !std::isfinite(bound)) {
      return perfect.ok() ? absl::StatusOr<double>(store::kUnknown) : perfect.status();
    }
    return *perfect - bound * Readings() / 2;
  }

  double Readings() const { return static_cast<double>(definition_.data.readings.size()); }

  /// ln likelihood of a run that agrees with every reading.
  absl::StatusOr<double> Perfect() const {
    ASSIGN_OR_RETURN(
        const auto perfect,
        inference::LogLikelihoodBound(
            definition_.data, campaign_.filter,
            Eigen::MatrixXd::Constant(
                1, static_cast<Eigen::Index>(definition_.data.readings.size()), planning::kNone)));
    return perfect(0);
  }

  /// Of every point in order. Chi-squared is twice what the log likelihood lacks to that of perfect
  /// agreement.
  absl::StatusOr<std::vector<Result>> Results(const planning::History& history) const {
    const auto perfect = Perfect();
    const auto batches = planning::LogLikelihoodsByBatch(definition_, history);
    if (!perfect.ok() || !batches.ok()) {
      return perfect.ok() ? batches.status() : perfect.status();
    }
    std::vector<Result> results;
    for (std::size_t k = 0; k < batches->size(); ++k) {
      ASSIGN_OR_RETURN(
          const auto highest,
          inference::LogLikelihoodBound(definition_.data, campaign_.filter, history.stopped[k]));
      for (Eigen::Index i = 0; i < (*batches)[k].size(); ++i) {
        Result& result = results.emplace_back();
        result.ended = history.ended[k][static_cast<std::size_t>(i)] != 0;
        const double value = (*batches)[k](i);
        if (result.ended && std::isfinite(value)) {
          result.value = 2 * (*perfect - value) / Readings();
        } else if (result.ended && std::isfinite(highest(i)) && highest(i) < *perfect) {
          result.at_least = 2 * (*perfect - highest(i)) / Readings();
        }
      }
    }
    return results;
  }

  /// The optimiser with all points of the history and no result.
  absl::StatusOr<State> Pending(const planning::History& history) const {
    State state;
    state.step = options_.max_step;
    for (std::size_t k = 0; k < history.proposals.size(); ++k) {
      ASSIGN_OR_RETURN(const auto points, UnitPoints(history.proposals[k]));
      const Eigen::Index samples = history.iterations[k].parameters.rows();
      if (points.rows() != samples) {
        return absl::DataLossError(absl::StrCat("iteration ", k, " has ", samples, " samples but ",
                                                points.rows(), " points"));
      }
      if (k == 0) {
        state.design = points;
      }
      for (Eigen::Index i = 0; i < points.rows(); ++i) {
        state.evaluations.push_back({.point = points.row(i)});
      }
    }
    return state;
  }

  /// The optimiser with all points chosen so far, and with the results of those that have ended if
  /// `ended`; without them all are pending.
  absl::StatusOr<State> Known(const planning::History& history,
                              const absl::StatusOr<std::vector<Result>>& results,
                              bool ended) const {
    auto state = Pending(history);
    if (!results.ok() || !state.ok()) {
      return results.ok() ? state.status() : results.status();
    }
    for (std::size_t i = 0; ended && i < results->size(); ++i) {
      const Result& result = (*results)[i];
      if (!result.ended) {
        continue;
      }
      RETURN_IF_ERROR(
          inference::Report(options_, static_cast<int>(i), result.value, *state, result.at_least));
    }
    return state;
  }

  /// reported: results that the state knows, the first ones.
  absl::StatusOr<Point> NextInOrder(const std::vector<Result>& results, std::size_t& reported,
                                    State& state) const {
    const std::size_t next = state.evaluations.size();
    if (static_cast<int>(next) >= options_.max_evaluations) {
      return Point{};
    }
    const auto lag = static_cast<std::size_t>(own_.in_flight);
    for (std::size_t wanted = next < lag ? 0 : next + 1 - lag;; ++wanted) {
      for (; reported < wanted; ++reported) {
        if (reported >= results.size() || !results[reported].ended) {
          return Point{};
        }
        const Result& result = results[reported];
        RETURN_IF_ERROR(inference::Report(options_, static_cast<int>(reported), result.value, state,
                                          result.at_least));
      }
      auto point = Choose(state);
      if (!point.ok() || point->has_value()) {
        return point;
      }
    }
  }

  absl::StatusOr<Point> NextAtOnce(State& state) const {
    const auto under_way = std::count_if(state.evaluations.begin(), state.evaluations.end(),
                                         [](const inference::Evaluation& e) {
                                           return e.status == inference::EvaluationStatus::kPending;
                                         });
    return under_way < own_.in_flight ? Choose(state) : Point{};
  }

  absl::StatusOr<Point> Choose(State& state) const {
    return own_.model == ResponseModel::kGaussianProcess
               ? inference::NextByExpectedImprovement(options_, state)
               : inference::NextPoint(options_, state, Interpolant(state));
  }

  /// The one kept since the last choice, where a new one would begin as it is.
  inference::CubicRbf& Interpolant(const State& state) const {
    std::optional<inference::CubicRbf>& memory = definition_.memory->Of<SurfaceSoFar>().interpolant;
    if (!memory.has_value()) memory.emplace(options_.dimensions);
    inference::CubicRbf& kept = *memory;
    bool same = kept.size() <= static_cast<int>(state.completed.size());
    for (int i = 0; same && i < kept.size(); ++i) {
      const inference::Evaluation& evaluation =
          state.evaluations[static_cast<std::size_t>(state.completed[static_cast<std::size_t>(i)])];
      same = kept.point(i) == evaluation.point && kept.value(i) == evaluation.value;
    }
    if (!same) {
      kept = inference::CubicRbf(options_.dimensions);
    }
    return kept;
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

  /// The best run, and no posterior.
  planning::Answer AnswerOf(const planning::History& history,
                            const inference::ResponseSurfaceState& state) const {
    planning::Answer answer;
    inference::Posterior& posterior = answer.weighted;
    posterior.log_weights =
        Eigen::VectorXd::Constant(static_cast<Eigen::Index>(history.samples.size()),
                                  -std::numeric_limits<double>::infinity());
    posterior.log_weights(state.best) = 0;
    const auto& best = history.samples[static_cast<std::size_t>(state.best)].parameters;
    for (const double value : best) {
      posterior.parameters.push_back({.mean = value,
                                      .sd = planning::kNone,
                                      .cov = planning::kNone,
                                      .q05 = planning::kNone,
                                      .q50 = planning::kNone,
                                      .q95 = planning::kNone});
    }
    answer.weighted_members = planning::SummarizeMembers(
        campaign_,
        Eigen::Map<const Eigen::RowVectorXd>(best.data(), static_cast<Eigen::Index>(best.size())));
    posterior.log_evidence = posterior.log_evidence_se = posterior.pareto_k = planning::kNone;
    posterior.ess = 1;
    posterior.degeneracy = "An optimiser looks for the best fit and gives no posterior by itself.";
    return answer;
  }

  const planning::Definition& definition_;
  const campaign::Campaign& campaign_;
  const SurrogateOptions& own_;
  inference::ResponseSurfaceOptions options_;
};

}  // namespace

std::unique_ptr<planning::Planner> MakeSurrogatePlanner(const planning::Definition& definition,
                                                        const SurrogateOptions& options) {
  return std::make_unique<SurrogatePlanner>(definition, options);
}

}  // namespace calib::methods
