#include "inference/adaptive/next_batch.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "inference/numerics/infinity.h"
#include "inference/numerics/log_weights.h"
#include "inference/numerics/weighted_moments.h"
#include "inference/sampling/philox.h"
#include "inference/sampling/shuffle.h"
#include "inference/sampling/sobol.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr Index kIntegration = 250;  // points: the sum's own error is far below what a run changes
constexpr Index kNear = 60;          // candidates as the draws lie
constexpr Index kWide = 60;          // candidates farther out
constexpr int kSobol = 512;          // points of the prior for exploration
constexpr double kOptimism = 3;      // sd that an emulator may be off by and not know it
constexpr double kTwin = 1e-6;       // standardised; far below what matters, far above rounding

// Packings with the fewest runs first.
class Balance {
 public:
  Balance(int packings, const std::vector<int>& used)
      : count_(static_cast<std::size_t>(packings), 0) {
    for (const int p : used) ++count_[static_cast<std::size_t>(p)];
  }
  int Next() {
    const auto least = std::min_element(count_.begin(), count_.end());
    ++*least;
    return static_cast<int>(least - count_.begin());
  }

 private:
  std::vector<int> count_;
};

// `count` rows of a scrambled Sobol sequence that meet the prior's constraints.
Eigen::MatrixXd OfPrior(const JointPrior& prior, int count, std::uint64_t seed) {
  const auto d = static_cast<int>(prior.size());
  Eigen::MatrixXd result(count, d);
  Index found = 0;
  // A prior of which the constraints leave a ten-thousandth is the least that there is.
  for (int tried = 2 * count; found < count; tried *= 2) {
    const Eigen::MatrixXd cube = ScrambledSobol(tried, d, seed).cwiseMax(1e-12).cwiseMin(1 - 1e-12);
    found = 0;
    for (Index i = 0; i < cube.rows() && found < count; ++i) {
      const Eigen::VectorXd x = prior.FromUnit(cube.row(i).transpose());
      if (prior.InSupport(x)) result.row(found++) = x.transpose();
    }
  }
  return result;
}

// Parameters of a standardised place; what rounding put beyond a bound is drawn back.
Eigen::VectorXd Inside(const JointPrior& prior, const Eigen::RowVectorXd& place,
                       const Eigen::RowVectorXd& towards) {
  constexpr double kBack = 1e-9;
  Eigen::VectorXd x = prior.FromStandard(place.transpose());
  if (!prior.InSupport(x)) x = prior.FromStandard((place + kBack * (towards - place)).transpose());
  return x;
}

// Candidates, standardised: draws that cover where the density may be large, near and wide.
Eigen::MatrixXd Candidates(const AdaptiveProblem& problem, const AdaptivePosterior& posterior) {
  Eigen::MatrixXd result =
      posterior.standard(Resampled(posterior.log_cover, kNear + kWide), Eigen::all);
  const Eigen::RowVectorXd mean = WeightedMean(posterior.log_cover, posterior.standard).transpose();
  for (Index i = 0; i < result.rows(); ++i) {
    const double factor = i % 2 == 0 ? 1 : i % 4 == 1 ? 2 : 3;
    const Eigen::RowVectorXd moved = mean + factor * (result.row(i) - mean);
    if (problem.prior.InSupport(problem.prior.FromStandard(moved.transpose())))
      result.row(i) = moved;
  }
  return result;
}

// What runs at the candidates leave unknown of the likelihood at the points, after those chosen.
class ExpectedVariance {
 public:
  ExpectedVariance(const ResponseEmulator& emulator, const AdaptivePosterior& posterior,
                   const Eigen::MatrixXd& candidates)
      : own_(emulator.errors().Own()), run_(emulator.errors().specimen) {
    const std::vector<Index> rows = Resampled(posterior.log_cover, kIntegration);
    const Eigen::MatrixXd points = posterior.standard(rows, Eigen::all);
    const EmulatorPrediction prediction = emulator.Predict(points);
    square_ = (prediction.mean.rowwise() - emulator.measured().transpose()).array().square();
    first_ = begun_ = variance_ = prediction.variance;
    // The integral over the cube of f is the mean of f / sqrt(E[L^2]) over points of this density.
    weight_.resize(points.rows());
    for (Index i = 0; i < weight_.size(); ++i) {
      const Index row = rows[static_cast<std::size_t>(i)];
      weight_[i] = -std::max(posterior.log_mean[row], posterior.log_root_square[row]);
    }
    weight_.array() -= weight_.minCoeff();
    with_points_ = emulator.Covariances(points, candidates);
    between_ = emulator.Covariances(candidates, candidates);
  }

  // The integral of E_D[E[L | D]^2] with this candidate beside those taken, but for a factor.
  double Known(Index candidate) const {
    Eigen::ArrayXXd left(variance_.rows(), variance_.cols());
    for (Index k = 0; k < own_.size(); ++k) {
      const auto at = static_cast<std::size_t>(k);
      const double total = std::max(between_[at](candidate, candidate), 0.0) + run_[k];
      left.col(k) =
          (variance_.col(k) - with_points_[at].col(candidate).array().square() / total).max(0);
    }
    return LogSquare(left);
  }

  // Part of the variance that those taken since Begin() are expected to end.
  double Gain() const {
    const double all = LogSquare(Eigen::ArrayXXd::Zero(first_.rows(), first_.cols()));
    const double before = std::exp(LogSquare(begun_) - all);
    const double after = std::exp(LogSquare(variance_) - all);
    return before < 1 ? std::clamp((after - before) / (1 - before), 0.0, 1.0) : 0;
  }

  // What those taken so far end is not counted as gain of the others.
  void Begin() { begun_ = variance_; }

  void Take(Index candidate) {
    for (Index k = 0; k < own_.size(); ++k) {
      const auto at = static_cast<std::size_t>(k);
      const double total = std::max(between_[at](candidate, candidate), 0.0) + run_[k];
      const Eigen::VectorXd points = with_points_[at].col(candidate);
      const Eigen::VectorXd others = between_[at].col(candidate);
      variance_.col(k) = (variance_.col(k) - points.array().square() / total).max(0);
      with_points_[at] -= points * others.transpose() / total;
      between_[at] -= others * others.transpose() / total;
    }
  }

 private:
  // ln of the integral of the square of what is then expected of L, but for a factor, where data
  // leave these variances.
  double LogSquare(const Eigen::ArrayXXd& left) const {
    Eigen::ArrayXd sum = weight_;
    for (Index k = 0; k < own_.size(); ++k) {
      const Eigen::ArrayXd spread = 0.5 * (own_[k] + left.col(k)) + first_.col(k) - left.col(k);
      sum -= 0.5 * ((own_[k] + left.col(k)) * spread).log() + 0.5 * square_.col(k) / spread;
    }
    return LogSumExp(sum.matrix());
  }

  Eigen::VectorXd own_, run_;
  Eigen::ArrayXXd square_, first_, begun_, variance_;  // points x q
  Eigen::ArrayXd weight_;                              // ln
  std::vector<Eigen::MatrixXd> with_points_, between_;
};

// Rows of the points, standardised, for which none of the given stands: each stands for the one
// that is nearest to it, if no other point is nearer to that.
std::vector<Index> NotStoodFor(const Eigen::MatrixXd& points, const Eigen::MatrixXd& given) {
  const Index n = points.rows();
  Eigen::VectorXd spacing = Eigen::VectorXd::Constant(n, kInfinity);
  for (Index i = 0; given.rows() > 0 && i < n; ++i) {
    for (Index j = 0; j < n; ++j)
      if (j != i) spacing[i] = std::min(spacing[i], (points.row(i) - points.row(j)).squaredNorm());
  }
  std::vector<bool> stood_for(static_cast<std::size_t>(n), false);
  for (Index g = 0; g < given.rows(); ++g) {
    Index nearest = 0;
    const double distance =
        (points.rowwise() - given.row(g)).rowwise().squaredNorm().minCoeff(&nearest);
    if (distance <= spacing[nearest]) stood_for[static_cast<std::size_t>(nearest)] = true;
  }
  std::vector<Index> kept;
  for (Index i = 0; i < n; ++i)
    if (!stood_for[static_cast<std::size_t>(i)]) kept.push_back(i);
  return kept;
}

std::vector<Index> Pending(const AdaptiveRuns& runs) {
  std::vector<Index> pending;
  for (Index i = 0; i < runs.rows(); ++i) {
    if (runs.end[static_cast<std::size_t>(i)] == RunEnd::kPending) pending.push_back(i);
  }
  return pending;
}

// The place, standardised, that is farthest from all runs among those that might yet fit.
Eigen::RowVectorXd Unexplored(const Eigen::MatrixXd& places, const Eigen::VectorXd& optimistic,
                              const Eigen::MatrixXd& done) {
  std::vector<Index> order(static_cast<std::size_t>(places.rows()));
  std::iota(order.begin(), order.end(), Index{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return optimistic[a] > optimistic[b]; });
  order.resize(order.size() / 4);
  Index best = order[0];
  double farthest = -1;
  for (const Index i : order) {
    const double nearest = (done.rowwise() - places.row(i)).rowwise().squaredNorm().minCoeff();
    if (nearest <= farthest) continue;
    farthest = nearest;
    best = i;
  }
  return places.row(best);
}

}  // namespace

AdaptiveBatch FirstRuns(const AdaptiveProblem& problem, int runs, int repeats, std::uint64_t seed,
                        const AdaptiveBatch& given) {
  const Eigen::MatrixXd points = OfPrior(problem.prior, runs, seed);
  std::vector<Index> kept = NotStoodFor(StandardRows(problem.prior, points.topRows(runs - repeats)),
                                        StandardRows(problem.prior, given.parameters));
  const auto fill = static_cast<int>(kept.size());
  for (int row = runs - repeats; row < runs; ++row) kept.push_back(row);
  runs = fill + repeats;
  AdaptiveBatch result{.parameters = points(kept, Eigen::all), .packing = {}};
  const int block = problem.packings;
  for (int first = 0; first < runs; first += block) {
    const std::vector<Index> order =
        Shuffled(block, PhiloxStream({.seed = seed,
                                      .purpose = StreamPurpose::kAdaptiveDesign,
                                      .iteration = 0,
                                      .sample = static_cast<std::uint64_t>(first)}));
    for (int i = 0; i < std::min(block, runs - first); ++i)
      result.packing.push_back(static_cast<int>(order[static_cast<std::size_t>(i)]));
  }
  for (int r = 0; r < repeats; ++r) {
    const int row = fill + r;
    const auto at = static_cast<std::size_t>(row);
    const AdaptiveBatch& of = r < fill ? result : given;
    const int repeated = r < fill ? r : r - fill;
    Eigen::VectorXd x = of.parameters.row(repeated).transpose();
    if (problem.packings > 1) {
      if (result.packing[at] == of.packing[static_cast<std::size_t>(repeated)])
        result.packing[at] = (result.packing[at] + 1) % problem.packings;
    } else {
      Eigen::VectorXd s = problem.prior.ToStandard(x);
      for (Index j = 0; j < s.size(); ++j) s[j] -= std::copysign(kTwin, s[j]);
      const Eigen::VectorXd moved = problem.prior.FromStandard(s);
      if (problem.prior.InSupport(moved)) x = moved;
    }
    result.parameters.row(row) = x.transpose();
  }
  return result;
}

AdaptiveBatch NextBatch(const AdaptiveProblem& problem, const AdaptiveRuns& runs,
                        const ResponseEmulator& emulator, const KnownRegion& region,
                        const AdaptivePosterior& posterior, const BatchOptions& options) {
  const Eigen::MatrixXd chosen_from = Candidates(problem, posterior);
  Eigen::MatrixXd done(runs.rows() + options.runs, chosen_from.cols());
  done.topRows(runs.rows()) = StandardRows(problem.prior, runs.parameters);
  const std::vector<Index> pending = Pending(runs);
  Eigen::MatrixXd candidates(chosen_from.rows() + std::ssize(pending), chosen_from.cols());
  candidates << chosen_from, done(pending, Eigen::all);
  ExpectedVariance expected(emulator, posterior, candidates);
  for (Index i = chosen_from.rows(); i < candidates.rows(); ++i) expected.Take(i);
  expected.Begin();
  Index count = runs.rows();
  std::vector<bool> taken(static_cast<std::size_t>(chosen_from.rows()), false);
  for (int step = 0; step < options.runs - options.explore; ++step) {
    Index best = -1;
    double most = -kInfinity;
    for (Index i = 0; i < chosen_from.rows(); ++i) {
      // On one packing the same run again says nothing; on others it is one run among many.
      if (taken[static_cast<std::size_t>(i)]) continue;
      const double known = expected.Known(i);
      if (best >= 0 && !(known > most)) continue;
      most = known;
      best = i;
    }
    if (best < 0) break;
    taken[static_cast<std::size_t>(best)] = true;
    expected.Take(best);
    done.row(count++) = candidates.row(best);
  }
  if (options.explore > 0) {
    const Eigen::MatrixXd places = StandardRows(
        problem.prior, OfPrior(problem.prior, kSobol, options.seed + 1 + options.number));
    EmulatorPrediction prediction = emulator.Predict(places);
    prediction.variance *= kOptimism * kOptimism;
    // By the distance alone: a density would punish where little is known.
    const Eigen::ArrayXXd variance = DiagonalVariance(prediction, emulator.errors()).array();
    const Eigen::VectorXd optimistic =
        region.LogProbability(places) -
        0.5 * ((prediction.mean.rowwise() - emulator.measured().transpose()).array().square() /
               variance)
                  .rowwise()
                  .sum()
                  .matrix();
    for (int e = 0; e < options.explore; ++e) {
      done.row(count) = Unexplored(places, optimistic, done.topRows(count));
      ++count;
    }
  }
  AdaptiveBatch result{.parameters = Eigen::MatrixXd(count - runs.rows(), candidates.cols()),
                       .packing = {},
                       .expected_gain = expected.Gain()};
  Balance balance(problem.packings, runs.packing);
  for (Index i = runs.rows(); i < count; ++i) {
    result.parameters.row(i - runs.rows()) =
        Inside(problem.prior, done.row(i), posterior.mean.transpose()).transpose();
    result.packing.push_back(balance.Next());
  }
  return result;
}

AdaptiveBatch VerifyingRuns(const AdaptiveProblem& problem, const AdaptiveRuns& runs,
                            const AdaptivePosterior& posterior, int number) {
  AdaptiveBatch result{
      .parameters = posterior.draws(Resampled(posterior.log_weights, number), Eigen::all),
      .packing = {}};
  Balance balance(problem.packings, runs.packing);
  for (Index i = 0; i < result.parameters.rows(); ++i) result.packing.push_back(balance.Next());
  return result;
}

}  // namespace calib::inference
