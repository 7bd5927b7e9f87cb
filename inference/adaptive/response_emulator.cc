#include "inference/adaptive/response_emulator.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/emulator/stopped_runs.h"
#include "inference/numerics/decompositions.h"
#include "inference/numerics/infinity.h"
#include "inference/numerics/special_functions.h"
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

// ln of the density of errors by their variances, without the constant; over these rows.
double LogDensityOf(const Eigen::VectorXd& error, const Eigen::VectorXd& variance,
                    const std::vector<Index>& rows) {
  double sum = 0;
  for (const Index i : rows)
    sum -= 0.5 * (error[i] * error[i] / variance[i] + std::log(variance[i]));
  return sum;
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
  result.Choose(learned.inputs, outputs, learned.packing);
  result.CompareWithRepeats(learned.inputs.topRows(learned.complete),
                            outputs.topRows(learned.complete));
  return result;
}

void ResponseEmulator::Choose(const Eigen::MatrixXd& inputs, const Eigen::MatrixXd& outputs,
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
  for (Index k = 0; k < q; ++k) {
    double best = -kInfinity, run = 0, specimen = 0;
    Eigen::VectorXd error, variance;
    int chosen = 0;
    const auto consider = [&](int degree, const Eigen::VectorXd& e, const Eigen::VectorXd& v) {
      const double density = LogDensityOf(e, v, relevant);
      if (!(density > best)) return;
      best = density;
      error = e;
      variance = v;
      chosen = degree;
    };
    for (std::size_t g = 0; g < polynomials_.size(); ++g) {
      const LeftOutRuns& left = polynomials_[g].left_out();
      consider(static_cast<int>(g), left.error.col(k), left.variance.col(k));
    }
    const std::optional<GaussianProcess>& process = processes_[static_cast<std::size_t>(k)];
    if (process) consider(-1, process->leave_one_out().error, process->leave_one_out().variance);
    degree_.push_back(chosen);
    double freedom = 0;
    if (chosen < 0) {
      run = process->scatter_variance();
      specimen = run + process->group_variance();
      freedom = 0.5 * static_cast<double>(n);  // the process may bend as often as every other run
    } else {
      const FeatureEmulator& polynomial = polynomials_[static_cast<std::size_t>(chosen)];
      run = polynomial.variances().run[k];
      specimen = polynomial.specimen()[k];
      freedom = std::max(static_cast<double>(n) - polynomial.used(), 0.3 * static_cast<double>(n));
    }
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

EmulatorPrediction ResponseEmulator::Predict(const Eigen::MatrixXd& standard) const {
  const Index m = standard.rows(), q = coordinates();
  EmulatorPrediction result{.mean = Eigen::MatrixXd(m, q),
                            .variance = Eigen::MatrixXd(m, q),
                            .added_run_variance = Eigen::VectorXd::Zero(m)};
  std::vector<std::optional<EmulatorPrediction>> of_degree(polynomials_.size());
  for (Index k = 0; k < q; ++k) {
    const int degree = degree_[static_cast<std::size_t>(k)];
    if (degree < 0) {
      const GaussianProcessPrediction at =
          processes_[static_cast<std::size_t>(k)]->Predict(standard);
      result.mean.col(k) = at.mean;
      result.variance.col(k) = widening_[k] * at.variance;
      continue;
    }
    auto& at = of_degree[static_cast<std::size_t>(degree)];
    if (!at) at = polynomials_[static_cast<std::size_t>(degree)].Predict(PointsAt(standard));
    result.mean.col(k) = at->mean.col(k);
    result.variance.col(k) = widening_[k] * at->variance.col(k);
  }
  return result;
}

Eigen::MatrixXd ResponseEmulator::Covariance(Index k, const Eigen::MatrixXd& a,
                                             const Eigen::MatrixXd& b) const {
  const int degree = degree_[static_cast<std::size_t>(k)];
  if (degree < 0) return widening_[k] * processes_[static_cast<std::size_t>(k)]->Covariance(a, b);
  const FeatureEmulator& polynomial = polynomials_[static_cast<std::size_t>(degree)];
  return widening_[k] * polynomial.Factor(PointsAt(a)) * polynomial.shrink().col(k).asDiagonal() *
         polynomial.Factor(PointsAt(b)).transpose();
}

}  // namespace calib::inference
