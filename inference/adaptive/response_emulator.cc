#include "inference/adaptive/response_emulator.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/emulator/stopped_runs.h"
#include "inference/numerics/decompositions.h"
#include "inference/numerics/infinity.h"
#include "inference/numerics/log_weights.h"
#include "inference/numerics/special_functions.h"
#include "inference/sampling/philox.h"
#include "inference/scatter/shrunk_covariance.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr int kMostDegree = 4;
constexpr Index kLeastRelevant = 20;  // runs; fewer do not tell emulators apart
// Standardised distance of two runs that count as one; chosen: twins differ by a millionth.
constexpr double kRepeated = 1e-5;

DesignPoints PointsAt(const Eigen::MatrixXd& standard) {
  return {.base = standard,
          .strength = Eigen::MatrixXd(standard.rows(), 0),
          .shape = Eigen::MatrixXd(standard.rows(), 0)};
}

// Polynomials of all degrees with at least two runs a coefficient.
absl::StatusOr<std::vector<FeatureEmulator>> FitPolynomials(const Eigen::MatrixXd& inputs,
                                                            const Eigen::MatrixXd& outputs,
                                                            const std::vector<int>& packing) {
  std::vector<FeatureEmulator> result;
  const EmulatorData data{
      .points = PointsAt(inputs), .packing = packing, .outputs = outputs, .differences = {}};
  for (int degree = 0; degree <= kMostDegree; ++degree) {
    const EffectFeatures features(inputs.cols(), {}, degree);
    const Index terms = features.base_count();
    if (degree > 1 && (inputs.rows() < terms + 10 || inputs.rows() < 2 * terms)) break;
    ASSIGN_OR_RETURN(auto emulator, FeatureEmulator::Fit(features, data));
    result.push_back(std::move(emulator));
  }
  return result;
}

// Errors of runs left out and their variances by several emulators, n x m; no finite variance where
// there is no such emulator.
struct LeftOut {
  Eigen::ArrayXXd error, variance;
};

// Weights of emulators by the log density of runs left out: the mean, over resampled runs, of those
// proportional to the density of them all.    [Yao et al., Bayesian Anal. 13 (2018) 917, sec. 3.4]
Eigen::VectorXd WeightsOf(const LeftOut& left, const std::vector<Index>& runs) {
  constexpr int kResampled = 400;        // weights are known to a few percent
  constexpr double kLeastWeight = 1e-3;  // far below that
  const Eigen::ArrayXXd error = left.error(runs, Eigen::all);
  const Eigen::ArrayXXd variance = left.variance(runs, Eigen::all);
  Eigen::MatrixXd density = (-0.5 * (error.square() / variance + variance.log())).matrix();
  for (double& value : density.reshaped()) {
    if (!std::isfinite(value)) value = -kInfinity;
  }
  const auto count = static_cast<Index>(runs.size());
  Eigen::VectorXd result = Eigen::VectorXd::Zero(density.cols());
  if (!(density.colwise().sum().maxCoeff() > -kInfinity)) {
    result[0] = 1;  // none has a density at every run: the simplest
    return result;
  }
  for (int b = 0; b < kResampled; ++b) {
    // The same for every coordinate and decision, so that weights move by what is learned alone.
    PhiloxStream stream({.seed = 0,
                         .purpose = StreamPurpose::kAdaptiveErrors,
                         .iteration = std::numeric_limits<std::uint64_t>::max(),  // no decision's
                         .sample = static_cast<std::uint64_t>(b)});
    Eigen::VectorXd times(count);
    for (double& value : times) value = -std::log(1 - stream.Uniform());
    times *= static_cast<double>(count) / times.sum();
    const Eigen::VectorXd sum = density.transpose() * times;
    result += NormalizedLogWeights(sum).array().exp().matrix();
  }
  result /= result.sum();
  result = (result.array() < kLeastWeight).select(0, result);
  return result / result.sum();
}

// Rows of the least distances, ascending.
std::vector<Index> Nearest(const Eigen::VectorXd& distance, Index count) {
  std::vector<Index> order(static_cast<std::size_t>(distance.size()));
  std::iota(order.begin(), order.end(), Index{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return distance[a] < distance[b]; });
  order.resize(static_cast<std::size_t>(std::min<Index>(count, distance.size())));
  std::sort(order.begin(), order.end());
  return order;
}

// Pairs of runs of the same parameters, or next to the same; each run in one at most.
std::vector<std::pair<Index, Index>> Repeats(const Eigen::MatrixXd& inputs) {
  std::vector<std::pair<Index, Index>> result;
  std::vector<bool> used(static_cast<std::size_t>(inputs.rows()), false);
  for (Index i = 0; i < inputs.rows(); ++i) {
    for (Index j = 0; j < i; ++j) {
      if (used[static_cast<std::size_t>(j)] || (inputs.row(i) - inputs.row(j)).norm() > kRepeated)
        continue;
      result.emplace_back(j, i);
      used[static_cast<std::size_t>(i)] = used[static_cast<std::size_t>(j)] = true;
      break;
    }
  }
  return result;
}

// The best of all degrees, all coordinates taken together.
const FeatureEmulator& BestOf(const std::vector<FeatureEmulator>& polynomials) {
  return *std::max_element(polynomials.begin(), polynomials.end(),
                           [](const FeatureEmulator& a, const FeatureEmulator& b) {
                             return a.left_out().log_density < b.left_out().log_density;
                           });
}

// Runs as an emulator learns from them: complete ones, then early ends that could be completed.
struct Learned {
  Eigen::MatrixXd inputs, outputs;
  std::vector<int> packing;
  Index complete = 0;
};

// The outputs are coordinates freed of their noise's correlations from stage to stage, so that what
// a run came to stands at the head of its row whatever it lacks.
Learned CompleteAndEarly(const Eigen::MatrixXd& standard, const AdaptiveRuns& runs,
                         const Eigen::RowVectorXd& mean, const Eigen::LLT<Eigen::MatrixXd>& noise,
                         std::uint64_t seed) {
  std::vector<Index> complete, early;
  Learned result;
  for (Index i = 0; i < runs.rows(); ++i) {
    const RunEnd end = runs.end[static_cast<std::size_t>(i)];
    if (end == RunEnd::kComplete) {
      complete.push_back(i);
      result.packing.push_back(runs.packing[static_cast<std::size_t>(i)]);
    }
    if (end == RunEnd::kEarly && std::isfinite(runs.coordinates(i, 0))) early.push_back(i);
  }
  result.complete = static_cast<Index>(complete.size());
  const Eigen::MatrixXd centred = runs.coordinates.rowwise() - mean;
  result.inputs = standard(complete, Eigen::all);
  result.outputs =
      LowerSolved(noise, Eigen::MatrixXd(centred(complete, Eigen::all)).transpose()).transpose();
  if (early.empty()) return result;
  std::vector<Index> all(complete.size());
  std::iota(all.begin(), all.end(), Index{0});
  const auto emulator = StateEmulator::Fit(result.inputs, result.outputs, all, {});
  if (!emulator.ok()) return result;  // nothing to tell from what they lack
  const Runs finished{.inputs = result.inputs, .histories = result.outputs};
  for (const Index i : early) {
    Index reached = 0;
    while (reached < mean.size() && std::isfinite(centred(i, reached))) ++reached;
    Eigen::VectorXd padded = Eigen::VectorXd::Zero(mean.size());
    padded.head(reached) = centred.row(i).head(reached).transpose();
    Eigen::MatrixXd row = LowerSolved(noise, padded).transpose();
    row.rightCols(mean.size() - reached).setConstant(std::nan(""));
    const Runs one = CompletedRuns(finished, {.inputs = standard.row(i), .histories = row},
                                   *emulator, {.seed = seed + static_cast<std::uint64_t>(i)});
    if (one.inputs.rows() == finished.inputs.rows()) continue;
    const Index n = result.inputs.rows();
    result.inputs.conservativeResize(n + 1, Eigen::NoChange);
    result.outputs.conservativeResize(n + 1, Eigen::NoChange);
    result.inputs.row(n) = one.inputs.bottomRows(1);
    result.outputs.row(n) = one.histories.bottomRows(1);
    result.packing.push_back(runs.packing[static_cast<std::size_t>(i)]);
  }
  return result;
}

}  // namespace

absl::StatusOr<ResponseEmulator> ResponseEmulator::Fit(const AdaptiveProblem& problem,
                                                       const AdaptiveRuns& runs,
                                                       std::uint64_t seed) {
  const Index q = problem.measured.size(), d = static_cast<Index>(problem.prior.size());
  Index complete = 0;
  Eigen::RowVectorXd mean = Eigen::RowVectorXd::Zero(q);
  for (Index i = 0; i < runs.rows(); ++i) {
    if (runs.end[static_cast<std::size_t>(i)] != RunEnd::kComplete) continue;
    mean += runs.coordinates.row(i);
    ++complete;
  }
  if (complete < LeastRuns(d)) {
    return absl::FailedPreconditionError(absl::StrCat(
        complete, " complete runs; ", d, " parameters take ", LeastRuns(d), " at least"));
  }
  mean /= static_cast<double>(complete);
  const Eigen::LLT<Eigen::MatrixXd> noise(problem.noise);
  Learned learned =
      CompleteAndEarly(StandardRows(problem.prior, runs.parameters), runs, mean, noise, seed);
  const Index n = learned.inputs.rows();

  // Scatter about a polynomial, in units of the noise.
  const Eigen::RowVectorXd sd =
      (learned.outputs.cwiseAbs2().colwise().mean().array() + 1e-300).sqrt();
  const Eigen::MatrixXd scaled = learned.outputs.array().rowwise() / sd.array();
  ASSIGN_OR_RETURN(auto first, FitPolynomials(learned.inputs, scaled, learned.packing));
  const FeatureEmulator& trend = BestOf(first);
  const auto count = static_cast<double>(n);
  const Eigen::MatrixXd departures = trend.residuals() * sd.asDiagonal() *
                                     std::sqrt(count / std::max(count - trend.used(), 0.3 * count));
  const Eigen::MatrixXd target =
      (departures.cwiseAbs2().colwise().mean().array() + 1e-300).matrix().asDiagonal();
  std::vector<int> group = learned.packing;
  if (problem.packings == 1) std::iota(group.begin(), group.end(), 0);
  const Eigen::MatrixXd scatter =
      ShrinkCovariance(departures, group, target, target + Eigen::MatrixXd::Identity(q, q))
          .covariance;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scatter);
  const Eigen::VectorXd total = 1 + problem.share * eigen.eigenvalues().cwiseMax(0).array();

  ResponseEmulator result;
  result.mean_ = mean;
  const Eigen::MatrixXd scale =
      total.cwiseSqrt().cwiseInverse().asDiagonal() * eigen.eigenvectors().transpose();
  result.turn_ = scale * LowerSolved(noise, Eigen::MatrixXd::Identity(q, q));
  result.log_jacobian_ =
      -0.5 * total.array().log().sum() - noise.matrixLLT().diagonal().array().log().sum();
  result.measured_ = result.turn_ * (problem.measured - mean.transpose());
  result.errors_ = {
      .noise = total.cwiseInverse(), .staging = Eigen::MatrixXd(q, 0), .share = problem.share};
  const Eigen::MatrixXd outputs = learned.outputs * scale.transpose();
  if (!outputs.allFinite() || !result.measured_.allFinite()) {
    return absl::FailedPreconditionError(
        "the coordinates of the runs exceed what numbers can hold");
  }
  ASSIGN_OR_RETURN(result.polynomials_, FitPolynomials(learned.inputs, outputs, learned.packing));
  for (Index k = 0; k < q; ++k) {
    // A coordinate that no process can be fitted to has its polynomial.
    auto process = GaussianProcess::Fit(
        learned.inputs, outputs.col(k),
        {.may_be_constant = false,
         .groups = problem.packings > 1 ? learned.packing : std::vector<int>{}});
    result.processes_.emplace_back();
    if (process.ok()) result.processes_.back() = *std::move(process);
  }
  result.quality_ = {.complete = learned.complete, .early = n - learned.complete};
  result.Weigh(learned.inputs, outputs, learned.packing);
  result.CompareWithRepeats(learned.inputs.topRows(learned.complete),
                            outputs.topRows(learned.complete));
  return result;
}

void ResponseEmulator::Weigh(const Eigen::MatrixXd& inputs, const Eigen::MatrixXd& outputs,
                             const std::vector<int>& packing) {
  const Index n = inputs.rows(), q = outputs.cols();
  const FeatureEmulator& all = BestOf(polynomials_);
  const Eigen::MatrixXd left_out = outputs - all.left_out().error;
  const Eigen::VectorXd distance = ((left_out.rowwise() - measured_.transpose()).array().square() /
                                    (1 + all.left_out().variance.array()))
                                       .rowwise()
                                       .sum();
  const std::vector<Index> relevant = Nearest(distance, std::max(kLeastRelevant, n / 2));
  std::vector<int> numbers = packing;
  std::sort(numbers.begin(), numbers.end());
  const auto packings =
      static_cast<double>(std::unique(numbers.begin(), numbers.end()) - numbers.begin());

  // A run that was repeated is told by its repeat.
  std::vector<bool> repeated(static_cast<std::size_t>(n), false);
  for (const auto& [a, b] : Repeats(inputs))
    repeated[static_cast<std::size_t>(a)] = repeated[static_cast<std::size_t>(b)] = true;
  std::vector<Index> alone;
  for (Index i = 0; i < n; ++i) {
    if (!repeated[static_cast<std::size_t>(i)]) alone.push_back(i);
  }
  if (alone.empty()) alone = relevant;
  widening_.resize(q);
  errors_.specimen.resize(q);
  errors_.run.resize(q);
  // Of the freedom from which the sum of scatter and noise is known, and the scatter alone; means.
  double inverse = 0, inverse_of_scatter = 0;
  quality_.explained = -kInfinity;
  quality_.calibration = 0;
  const auto degrees = static_cast<Index>(polynomials_.size());
  weights_.resize(q, degrees + 1);
  for (Index k = 0; k < q; ++k) {
    LeftOut left{.error = Eigen::ArrayXXd::Zero(n, degrees + 1),
                 .variance = Eigen::ArrayXXd::Constant(n, degrees + 1, kInfinity)};
    Eigen::VectorXd run_of = Eigen::VectorXd::Zero(degrees + 1);
    Eigen::VectorXd specimen_of = run_of, freedom_of = run_of;
    for (Index g = 0; g < degrees; ++g) {
      const FeatureEmulator& polynomial = polynomials_[static_cast<std::size_t>(g)];
      left.error.col(g) = polynomial.left_out().error.col(k);
      left.variance.col(g) = polynomial.left_out().variance.col(k);
      run_of[g] = polynomial.variances().run[k];
      specimen_of[g] = polynomial.specimen()[k];
      freedom_of[g] =
          std::max(static_cast<double>(n) - polynomial.used(), 0.3 * static_cast<double>(n));
    }
    if (const auto& process = processes_[static_cast<std::size_t>(k)]) {
      left.error.col(degrees) = process->leave_one_out().error;
      left.variance.col(degrees) = process->leave_one_out().variance;
      run_of[degrees] = process->scatter_variance();
      specimen_of[degrees] = process->scatter_variance() + process->group_variance();
      // It may bend as often as every other run.
      freedom_of[degrees] = 0.5 * static_cast<double>(n);
    }
    const Eigen::VectorXd weight = WeightsOf(left, relevant);
    weights_.row(k) = weight.transpose();
    Eigen::VectorXd error = Eigen::VectorXd::Zero(n), variance = error;
    for (Index g = 0; g <= degrees; ++g)
      if (weight[g] > 0) error += weight[g] * left.error.col(g).matrix();
    for (Index g = 0; g <= degrees; ++g) {
      if (weight[g] == 0) continue;
      variance.array() +=
          weight[g] * (left.variance.col(g) + (left.error.col(g) - error.array()).square());
    }
    const double run = weight.dot(run_of), specimen = weight.dot(specimen_of);
    const double freedom = weight.dot(freedom_of);
    double square = 0;
    for (const Index i : relevant) square += error[i] * error[i] / variance[i];
    square /= static_cast<double>(relevant.size());
    quality_.calibration += square / static_cast<double>(q);
    widening_[k] = std::max(1.0, square);
    errors_.run[k] = widening_[k] * run;
    errors_.specimen[k] = widening_[k] * specimen;
    const double spread =
        (outputs.col(k).array() - outputs.col(k).mean()).matrix()(alone).squaredNorm();
    const double missed = error(alone).squaredNorm();
    quality_.mean_square += missed / static_cast<double>(alone.size()) / static_cast<double>(q);
    if (spread > 0) quality_.explained = std::max(quality_.explained, 1 - missed / spread);
    // Satterthwaite, with a noise that is known and scatter of runs and of packings that is not.
    const double of_run = errors_.share * errors_.run[k];
    const double between = errors_.share * errors_.specimen[k] - of_run;
    const double whole = of_run + between + errors_.noise[k];
    const double not_known =
        (of_run * of_run / freedom + (packings > 1 ? between * between / (packings - 1) : 0.0)) /
        static_cast<double>(q);
    inverse += not_known / (whole * whole);
    if (of_run + between > 0)
      inverse_of_scatter += not_known / ((of_run + between) * (of_run + between));
  }
  scatter_freedom_ = inverse_of_scatter > 0 ? 1 / inverse_of_scatter : kInfinity;
  errors_.freedom = inverse > 0 ? 1 / inverse : kInfinity;
  // Known as well as that it is normal; Student's law of so many is no longer exact in numbers.
  constexpr double kNormal = 1e4;
  if (errors_.freedom > kNormal) errors_.freedom = kInfinity;
}

void ResponseEmulator::CompareWithRepeats(const Eigen::MatrixXd& inputs,
                                          const Eigen::MatrixXd& outputs) {
  const Index n = inputs.rows(), q = outputs.cols();
  const std::vector<std::pair<Index, Index>> repeats = Repeats(inputs);
  if (repeats.empty()) return;
  const auto pairs = static_cast<double>(repeats.size());
  Eigen::VectorXd square = Eigen::VectorXd::Zero(q);
  for (const auto& [a, b] : repeats)
    square += 0.5 * (outputs.row(a) - outputs.row(b)).cwiseAbs2().transpose();
  // Scatter below a hundredth of the measurement's variance is no matter, whatever it is.
  constexpr double kNoMatter = 0.01;
  const double claimed = errors_.specimen.sum() + kNoMatter * static_cast<double>(q);
  const double seen = square.sum() / pairs + kNoMatter * static_cast<double>(q);
  quality_.over_repeats = claimed / seen;
  quality_.errors_over_repeats = (quality_.mean_square + kNoMatter) * static_cast<double>(q) / seen;
  const double freedom = static_cast<double>(n) - static_cast<double>(inputs.cols()) - 1;
  // Coordinates scatter independently of each other: as many as count are witnesses.
  const double witnesses = square.sum() > 0 ? square.sum() * square.sum() / square.squaredNorm()
                                            : static_cast<double>(q);
  quality_.repeats_chance =
      FisherLaw{.numerator = std::max(freedom, 1.0) * witnesses, .denominator = pairs * witnesses}
          .Tail(quality_.over_repeats);
}

ResponseEmulator::Parts ResponseEmulator::PredictParts(const Eigen::MatrixXd& standard) const {
  Parts parts;
  for (std::size_t g = 0; g < polynomials_.size(); ++g) {
    parts.polynomials.emplace_back();
    if (weights_.col(static_cast<Index>(g)).maxCoeff() > 0)
      parts.polynomials.back() = polynomials_[g].Predict(PointsAt(standard));
  }
  for (Index k = 0; k < coordinates(); ++k) {
    parts.processes.emplace_back();
    if (weights_(k, weights_.cols() - 1) > 0)
      parts.processes.back() = processes_[static_cast<std::size_t>(k)]->Predict(standard);
  }
  return parts;
}

Eigen::MatrixXd ResponseEmulator::MeansOf(const Parts& parts, Index k, Index points) const {
  const auto degrees = static_cast<Index>(polynomials_.size());
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(points, degrees + 1);
  for (Index g = 0; g < degrees; ++g) {
    if (weights_(k, g) > 0)
      result.col(g) = parts.polynomials[static_cast<std::size_t>(g)]->mean.col(k);
  }
  if (weights_(k, degrees) > 0)
    result.col(degrees) = parts.processes[static_cast<std::size_t>(k)]->mean;
  return result;
}

EmulatorPrediction ResponseEmulator::Predict(const Eigen::MatrixXd& standard) const {
  const Index m = standard.rows(), q = coordinates(), degrees = weights_.cols() - 1;
  EmulatorPrediction result{.mean = Eigen::MatrixXd(m, q),
                            .variance = Eigen::MatrixXd::Zero(m, q),
                            .added_run_variance = Eigen::VectorXd::Zero(m)};
  const Parts parts = PredictParts(standard);
  for (Index k = 0; k < q; ++k) {
    const Eigen::MatrixXd means = MeansOf(parts, k, m);
    result.mean.col(k) = means * weights_.row(k).transpose();
    auto variance = result.variance.col(k);
    for (Index g = 0; g <= degrees; ++g) {
      if (weights_(k, g) == 0) continue;
      const Eigen::VectorXd own =
          g < degrees
              ? Eigen::VectorXd(parts.polynomials[static_cast<std::size_t>(g)]->variance.col(k))
              : parts.processes[static_cast<std::size_t>(k)]->variance;
      variance += weights_(k, g) * (own + (means.col(g) - result.mean.col(k)).cwiseAbs2());
    }
    variance *= widening_[k];
  }
  return result;
}

std::vector<Eigen::MatrixXd> ResponseEmulator::Covariances(const Eigen::MatrixXd& a,
                                                           const Eigen::MatrixXd& b) const {
  const Index degrees = weights_.cols() - 1;
  const Parts of_a = PredictParts(a), of_b = PredictParts(b);
  std::vector<Eigen::MatrixXd> result;
  for (Index k = 0; k < coordinates(); ++k) {
    const Eigen::VectorXd weight = weights_.row(k).transpose();
    const auto departures = [&](const Parts& parts, Index points) {
      const Eigen::MatrixXd means = MeansOf(parts, k, points);
      return Eigen::MatrixXd(means.colwise() - means * weight);
    };
    Eigen::MatrixXd covariance =
        departures(of_a, a.rows()) * weight.asDiagonal() * departures(of_b, b.rows()).transpose();
    for (Index g = 0; g < degrees; ++g) {
      if (weight[g] == 0) continue;
      const FeatureEmulator& polynomial = polynomials_[static_cast<std::size_t>(g)];
      covariance += weight[g] * polynomial.Factor(PointsAt(a)) *
                    polynomial.shrink().col(k).asDiagonal() *
                    polynomial.Factor(PointsAt(b)).transpose();
    }
    if (weight[degrees] > 0)
      covariance += weight[degrees] * processes_[static_cast<std::size_t>(k)]->Covariance(a, b);
    result.push_back(widening_[k] * covariance);
  }
  return result;
}

}  // namespace calib::inference
