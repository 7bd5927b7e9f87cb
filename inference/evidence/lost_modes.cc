#include "inference/evidence/lost_modes.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <utility>

#include "inference/numerics/decompositions.h"
#include "inference/numerics/infinity.h"
#include "inference/numerics/log_weights.h"
#include "inference/numerics/standard_normal.h"
#include "inference/sampling/sobol.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr int kNeighbours = 15;  // chosen: of as many in all directions one lies uphill; fewer
                                 // split slopes, more merge modes
constexpr double kEnough = 10;   // effective samples of a basin; chosen: its evidence is then known
                                 // to a third
constexpr Index kMost = 4000;    // samples looked at; chosen: a tenth of a second
constexpr Index kPerCoefficient =
    3;                           // runs of a linear model; chosen: a half over what it needs twice
constexpr int kSteps = 8;        // of Gauss-Newton; a quadratic takes one
constexpr int kPeakDraws = 256;  // of importance sampling; chosen: about 5 % of a Gaussian
constexpr double kWide = 3;  // sd of the Gaussian that holds what the readings do not, in those of
                             // the prior; chosen: wider than any prior
constexpr double kMostLeverage = 1;  // a prediction is then off by at most twice a run's own error

// The samples with weight, at most kMost of them.
std::vector<Index> Considered(const SampledModel& s) {
  std::vector<Index> all;
  for (Index i = 0; i < s.points.rows(); ++i) {
    if (s.log_start[i] > -kInfinity && s.log_likelihood[i] > -kInfinity) all.push_back(i);
  }
  const auto stride =
      std::max<std::size_t>(1, (all.size() + kMost - 1) / static_cast<std::size_t>(kMost));
  std::vector<Index> some;
  for (std::size_t k = 0; k < all.size(); k += stride) some.push_back(all[k]);
  return some;
}

// The `count` first of some rows of points, nearest to x first; ties by index.
std::vector<Index> Nearest(const Eigen::MatrixXd& points, const std::vector<Index>& rows,
                           const Eigen::RowVectorXd& x, std::size_t count) {
  std::vector<std::pair<double, Index>> by_distance;
  by_distance.reserve(rows.size());
  for (const Index i : rows) by_distance.emplace_back((points.row(i) - x).squaredNorm(), i);
  count = std::min(count, rows.size());
  std::partial_sort(by_distance.begin(), by_distance.begin() + static_cast<std::ptrdiff_t>(count),
                    by_distance.end());
  std::vector<Index> nearest;
  for (std::size_t k = 0; k < count; ++k) nearest.push_back(by_distance[k].second);
  return nearest;
}

// Predictions as a linear function of the points, by least squares.
struct LinearModel {
  Eigen::RowVectorXd origin;       // d
  Eigen::MatrixXd coefficients;    // (d + 1) x T
  Eigen::MatrixXd inverse_normal;  // (X^T X)^-1, for leverages

  static Eigen::MatrixXd Design(const Eigen::MatrixXd& points, const Eigen::RowVectorXd& origin) {
    Eigen::MatrixXd design(points.rows(), points.cols() + 1);
    design.col(0).setOnes();
    design.rightCols(points.cols()) = points.rowwise() - origin;
    return design;
  }
  [[nodiscard]] Eigen::MatrixXd At(const Eigen::MatrixXd& points) const {
    return Design(points, origin) * coefficients;
  }
  [[nodiscard]] double Leverage(const Eigen::RowVectorXd& x) const {
    const Eigen::RowVectorXd row = Design(x, origin);
    return row * inverse_normal * row.transpose();
  }
};

std::optional<LinearModel> FitLinear(const SampledModel& s, const std::vector<Index>& runs) {
  const Eigen::MatrixXd points = s.points(runs, Eigen::all);
  LinearModel model;
  model.origin = points.colwise().mean();
  const Eigen::MatrixXd design = LinearModel::Design(points, model.origin);
  const Eigen::LLT<Eigen::MatrixXd> normal(design.transpose() * design);
  if (normal.info() != Eigen::Success || normal.rcond() < 1e-12) return std::nullopt;
  model.inverse_normal = Solved(normal, Eigen::MatrixXd::Identity(design.cols(), design.cols()));
  model.coefficients =
      model.inverse_normal * (design.transpose() * s.predictions(runs, Eigen::all));
  return model;
}

// ln L of the linear model times a Gaussian that holds what the readings do not.
class Target {
 public:
  Target(const SampledModel& s, const LinearModel& model) : s_(s), model_(model) {}
  [[nodiscard]] Eigen::VectorXd At(const Eigen::MatrixXd& x) const {
    return Likelihood(x).array() - 0.5 * x.rowwise().squaredNorm().array() / (kWide * kWide);
  }
  [[nodiscard]] Eigen::VectorXd Likelihood(const Eigen::MatrixXd& x) const {
    return s_.likelihood(model_.At(x));
  }

 private:
  const SampledModel& s_;
  const LinearModel& model_;
};

struct Quadratic {
  double value = 0;
  Eigen::VectorXd gradient;
  Eigen::MatrixXd curvature;  // of the negative
};

// By differences, exact for a quadratic.
Quadratic Expand(const Target& target, const Eigen::RowVectorXd& x) {
  constexpr double kStep = 1e-3;  // of standardised coordinates; chosen
  const Index d = x.size();
  Eigen::MatrixXd rows(1 + 2 * d + d * (d - 1) / 2, d);
  rows.rowwise() = x;
  Index row = 1;
  for (Index i = 0; i < d; ++i) {
    rows(row++, i) += kStep;
    rows(row++, i) -= kStep;
  }
  for (Index i = 0; i < d; ++i) {
    for (Index j = 0; j < i; ++j, ++row) {
      rows(row, i) += kStep;
      rows(row, j) += kStep;
    }
  }
  const Eigen::VectorXd f = target.At(rows);
  Quadratic result{
      .value = f[0], .gradient = Eigen::VectorXd(d), .curvature = Eigen::MatrixXd(d, d)};
  const double square = kStep * kStep;
  for (Index i = 0; i < d; ++i) {
    result.gradient[i] = (f[1 + 2 * i] - f[2 + 2 * i]) / (2 * kStep);
    result.curvature(i, i) = -(f[1 + 2 * i] + f[2 + 2 * i] - 2 * f[0]) / square;
  }
  row = 1 + 2 * d;
  for (Index i = 0; i < d; ++i) {
    for (Index j = 0; j < i; ++j, ++row) {
      result.curvature(i, j) = result.curvature(j, i) =
          -(f[row] - f[1 + 2 * i] - f[1 + 2 * j] + f[0]) / square;
    }
  }
  return result;
}

// What a linear model expects of a basin.
struct Expected {
  Eigen::RowVectorXd peak;
  double leverage = 0;  // of the peak
  double log_evidence = 0;
};

std::optional<Expected> Expect(const SampledModel& s, const std::vector<Index>& runs,
                               const Eigen::RowVectorXd& start) {
  const auto model = FitLinear(s, runs);
  if (!model) return std::nullopt;
  const Target target(s, *model);
  Eigen::RowVectorXd x = start;
  Eigen::MatrixXd factor;
  double log_determinant = 0;
  for (int step = 0; step < kSteps; ++step) {
    const Quadratic at = Expand(target, x);
    const Eigen::LLT<Eigen::MatrixXd> curvature(at.curvature);
    if (!std::isfinite(at.value) || curvature.info() != Eigen::Success) return std::nullopt;
    factor = curvature.matrixL();
    log_determinant = 2 * factor.diagonal().array().log().sum();
    const Eigen::VectorXd move = Solved(curvature, at.gradient);
    x += move.transpose();
    if (move.norm() < 1e-6) break;
  }
  if (!x.allFinite()) return std::nullopt;
  // x + L^-T z, z standard normal: draws from the Gaussian of this curvature.
  const Index d = x.size();
  Eigen::MatrixXd z = ScrambledSobol(kPeakDraws, static_cast<int>(d), 0);
  for (double& value : z.reshaped()) value = NormalQuantile(value);
  const Eigen::MatrixXd draws =
      (factor.transpose().triangularView<Eigen::Upper>().solve(z.transpose()).transpose())
          .rowwise() +
      x;
  const Eigen::VectorXd log_drawn = 0.5 * log_determinant -
                                    0.5 * static_cast<double>(d) * std::log(2 * std::numbers::pi) -
                                    0.5 * z.rowwise().squaredNorm().array();
  const Eigen::VectorXd weights = s.log_prior(draws) + target.Likelihood(draws) - log_drawn;
  return Expected{.peak = x,
                  .leverage = model->Leverage(x),
                  .log_evidence = LogSumExp(weights) - std::log(kPeakDraws)};
}

// Runs of some rows, as many as a linear model takes.
std::vector<Index> RunsAbout(const SampledModel& s, const std::vector<Index>& rows,
                             const Eigen::RowVectorXd& x) {
  return Nearest(s.points, rows, x,
                 static_cast<std::size_t>(kPerCoefficient * (s.points.cols() + 1)));
}

// What some of the runs expect less what they do when one is left out. Empty where they expect
// nothing, with or without one of them.
std::optional<LostMode> WithError(const SampledModel& s, const std::vector<Index>& runs,
                                  const Basin& basin, const Expected& expected) {
  Eigen::VectorXd left_out(runs.size());
  for (std::size_t k = 0; k < runs.size(); ++k) {
    std::vector<Index> others = runs;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
    const auto without = Expect(s, others, expected.peak);
    if (!without) return std::nullopt;
    left_out[static_cast<Index>(k)] = without->log_evidence;
  }
  const auto n = static_cast<double>(runs.size());
  const double error = std::sqrt((n - 1) / n * (left_out.array() - left_out.mean()).square().sum());
  return LostMode{.best = basin.best,
                  .log_evidence = expected.log_evidence - error,
                  .error = error,
                  .found = basin.log_evidence};
}

// The mode that the basin's runs point to, with the place among the basins of that where it lies.
// Empty where that is one whose weights suffice, or the runs point to none.
std::optional<std::pair<LostMode, std::size_t>> Pointed(const SampledModel& s,
                                                        const std::vector<Basin>& basins,
                                                        const std::vector<std::size_t>& basin_of,
                                                        const std::vector<Index>& considered,
                                                        const Basin& basin) {
  const auto wanted = static_cast<std::size_t>(kPerCoefficient * (s.points.cols() + 1));
  if (basin.members.size() < wanted) return std::nullopt;
  const Eigen::RowVectorXd best = s.points.row(basin.best);
  std::vector<Index> runs = RunsAbout(s, basin.members, best);
  const auto first = Expect(s, runs, best);
  if (!first) return std::nullopt;
  runs = RunsAbout(s, basin.members, first->peak);
  const auto expected = Expect(s, runs, first->peak);
  if (!expected || expected->leverage > kMostLeverage) return std::nullopt;
  const Index nearest = Nearest(s.points, considered, expected->peak, 1).front();
  const std::size_t place = basin_of[static_cast<std::size_t>(nearest)];
  if (basins[place].ess >= kEnough) return std::nullopt;
  auto mode = WithError(s, runs, basin, *expected);
  if (!mode) return std::nullopt;
  return std::pair(*mode, place);
}

}  // namespace

std::vector<Basin> FindBasins(const SampledModel& s) {
  const std::vector<Index> considered = Considered(s);
  if (considered.empty()) return {};
  const Eigen::MatrixXd points = s.points(considered, Eigen::all);
  const Eigen::VectorXd density = s.log_likelihood(considered) + s.log_prior(points);
  std::vector<Index> places(considered.size());
  for (std::size_t k = 0; k < places.size(); ++k) places[k] = static_cast<Index>(k);
  std::vector<Index> up(considered.size());
  for (std::size_t k = 0; k < up.size(); ++k) {
    up[k] = static_cast<Index>(k);
    for (const Index j :
         Nearest(points, places, points.row(static_cast<Index>(k)), kNeighbours + 1)) {
      if (density[j] > density[up[k]]) up[k] = j;
    }
  }
  std::vector<Basin> of_top(considered.size());
  for (std::size_t k = 0; k < up.size(); ++k) {
    auto top = static_cast<Index>(k);
    while (up[static_cast<std::size_t>(top)] != top) top = up[static_cast<std::size_t>(top)];
    of_top[static_cast<std::size_t>(top)].members.push_back(considered[k]);
  }
  // Samples that were passed over count as drawn where their neighbours were.
  const Index with_weight =
      (s.log_start.array() > -kInfinity && s.log_likelihood.array() > -kInfinity).count();
  const double log_drawn =
      std::log(static_cast<double>(s.points.rows()) * static_cast<double>(considered.size()) /
               static_cast<double>(with_weight));
  std::vector<std::pair<double, Basin>> by_density;
  for (std::size_t k = 0; k < of_top.size(); ++k) {
    Basin& basin = of_top[k];
    if (basin.members.empty()) continue;
    const Eigen::VectorXd log_weights =
        s.log_start(basin.members) + s.log_likelihood(basin.members);
    basin.best = considered[k];
    basin.ess = EffectiveSampleSize(log_weights);
    basin.log_evidence = LogSumExp(log_weights) - log_drawn;
    by_density.emplace_back(density[static_cast<Index>(k)], std::move(basin));
  }
  std::stable_sort(by_density.begin(), by_density.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<Basin> basins;
  basins.reserve(by_density.size());
  for (auto& [density_of_best, basin] : by_density) basins.push_back(std::move(basin));
  return basins;
}

LostModes FindLostModes(const SampledModel& samples) {
  LostModes lost;
  const std::vector<Index> considered = Considered(samples);
  const std::vector<Basin> basins = FindBasins(samples);
  std::vector<std::size_t> basin_of(static_cast<std::size_t>(samples.points.rows()), 0);
  for (std::size_t k = 0; k < basins.size(); ++k) {
    for (const Index i : basins[k].members) basin_of[static_cast<std::size_t>(i)] = k;
  }
  const auto add = [](double a, double b) { return LogSumExp(Eigen::Vector2d(a, b)); };
  double found = -kInfinity;
  struct Shared {
    LostMode mode;
    std::set<std::size_t> basins;  // that point to it, and the one where it lies
  };
  std::map<std::size_t, Shared> at;  // by the basin where they lie
  for (std::size_t k = 0; k < basins.size(); ++k) {
    found = add(found, basins[k].log_evidence);
    if (basins[k].ess >= kEnough) continue;
    const auto pointed = Pointed(samples, basins, basin_of, considered, basins[k]);
    if (!pointed) continue;
    const auto& [mode, place] = *pointed;
    Shared& shared = at.try_emplace(place, Shared{mode, {place}}).first->second;
    if (mode.log_evidence > shared.mode.log_evidence) shared.mode = mode;
    shared.basins.insert(k);
  }
  double missing = -kInfinity;
  for (auto& [place, shared] : at) {
    LostMode& mode = shared.mode;
    mode.found = -kInfinity;
    for (const std::size_t k : shared.basins) mode.found = add(mode.found, basins[k].log_evidence);
    if (!(mode.log_evidence > mode.found)) continue;
    missing =
        add(missing, mode.log_evidence + std::log(-std::expm1(mode.found - mode.log_evidence)));
    lost.modes.push_back(mode);
  }
  std::stable_sort(lost.modes.begin(), lost.modes.end(), [](const LostMode& a, const LostMode& b) {
    return a.log_evidence > b.log_evidence;
  });
  if (!lost.modes.empty()) lost.log_evidence = std::log1p(std::exp(missing - found));
  return lost;
}

}  // namespace calib::inference
