#pragma once
// Simulators in closed form with scatter of packings and runs, a loop that calibrates them
// adaptively, and what the posterior is by brute force.

#include <Eigen/Dense>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "inference/adaptive/adaptive_decision.h"
#include "inference/numerics/log_weights.h"
#include "inference/sampling/philox.h"

namespace calib::inference {

/// Moments of a posterior in standardised coordinates, and its evidence.
struct ReferencePosterior {
  Eigen::VectorXd mean, sd;
  double log_evidence = 0;
};

/// A model of q coordinates. Scatter as a DEM has it, correlated from coordinate to coordinate:
/// runs that differ by nothing to speak of scatter by half the noise, packings by a third of it.
class AdaptiveToy {
 public:
  using Response = std::function<Eigen::VectorXd(const Eigen::VectorXd&)>;
  static constexpr double kRun = 0.5, kPacking = 0.3;  // sd in units of the noise's
  static constexpr int kPackings = 16;

  AdaptiveToy(JointPrior prior, Response response, Eigen::Index q, std::uint64_t seed,
              double scatter = 1)
      : response_(std::move(response)), seed_(seed) {
    Eigen::MatrixXd correlation(q, q);
    for (Eigen::Index i = 0; i < q; ++i) {
      for (Eigen::Index j = 0; j < q; ++j)
        correlation(i, j) = std::pow(0.6, std::abs(static_cast<double>(i - j)));
    }
    root_ = scatter * correlation.llt().matrixL().toDenseMatrix();
    scatter_ = (kRun * kRun + kPacking * kPacking) * scatter * scatter * correlation;
    problem_.prior = std::move(prior);
    problem_.noise = Eigen::MatrixXd::Identity(q, q);
    for (Eigen::Index i = 0; i + 1 < q; ++i)
      problem_.noise(i, i + 1) = problem_.noise(i + 1, i) = 0.3;
    problem_.packings = kPackings;
    for (int p = 0; p < kPackings; ++p) packing_.push_back(kPacking * root_ * Normal(q, 1, p));
    problem_.measured = Eigen::VectorXd::Zero(q);
  }

  /// What a specimen of its own at these parameters would show.
  void MeasureAt(const Eigen::VectorXd& x) {
    const Eigen::MatrixXd own = (problem_.noise + scatter_).llt().matrixL();
    problem_.measured = response_(x) + own * Normal(problem_.noise.rows(), 2, 0);
  }
  const AdaptiveProblem& problem() const { return problem_; }
  AdaptiveProblem& problem() { return problem_; }

  Eigen::VectorXd Run(const Eigen::VectorXd& x, int packing, Eigen::Index number) const {
    return response_(x) + packing_[static_cast<std::size_t>(packing)] +
           kRun * root_ * Normal(problem_.noise.rows(), 3, number);
  }
  /// Of a measurement about the mean over packings.
  Eigen::MatrixXd Covariance() const { return problem_.noise + scatter_; }
  double LogLikelihood(const Eigen::VectorXd& x) const {
    const Eigen::LLT<Eigen::MatrixXd> factor(problem_.noise + scatter_);
    const Eigen::VectorXd r = factor.matrixL().solve(problem_.measured - response_(x));
    return -0.5 * r.squaredNorm() - factor.matrixLLT().diagonal().array().log().sum() -
           0.5 * static_cast<double>(r.size()) * std::log(2 * std::numbers::pi);
  }
  /// By a midpoint rule of n^2 cells of equal prior mass, for two parameters.
  ReferencePosterior ByQuadrature(int n = 400) const {
    Eigen::MatrixXd s(n * n, 2);
    Eigen::VectorXd log_density(n * n);
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        const Eigen::VectorXd x =
            problem_.prior.FromUnit(Eigen::Vector2d((i + 0.5) / n, (j + 0.5) / n));
        s.row(i * n + j) = problem_.prior.ToStandard(x).transpose();
        log_density[i * n + j] = LogLikelihood(x);
      }
    }
    const double sum = LogSumExp(log_density);
    const Eigen::VectorXd w = (log_density.array() - sum).exp();
    ReferencePosterior result{.mean = s.transpose() * w, .sd = {}, .log_evidence = 0};
    result.sd =
        (((s.rowwise() - result.mean.transpose()).array().square()).matrix().transpose() * w)
            .cwiseSqrt();
    result.log_evidence = sum - 2 * std::log(n);
    return result;
  }

 private:
  Eigen::VectorXd Normal(Eigen::Index q, std::uint64_t what, Eigen::Index number) const {
    PhiloxStream stream({.seed = seed_,
                         .purpose = StreamPurpose::kTest,
                         .iteration = what,
                         .sample = static_cast<std::uint64_t>(number)});
    Eigen::VectorXd z(q);
    for (double& value : z) value = stream.Normal();
    return z;
  }

  Response response_;
  std::uint64_t seed_;
  AdaptiveProblem problem_;
  Eigen::MatrixXd root_, scatter_;
  std::vector<Eigen::VectorXd> packing_;
};

/// How a run of the toy ends, and up to which coordinate it then comes.
using EndOfRun = std::function<std::pair<RunEnd, Eigen::Index>(const Eigen::VectorXd&)>;

/// A calibration to its end.
struct AdaptiveLoop {
  AdaptiveRuns runs;
  std::vector<AdaptiveMemory> memory;
  AdaptiveDecision decision;
};

/// asynchronous: the next batch is chosen while one runs.
inline AdaptiveLoop Calibrate(const AdaptiveToy& toy, const AdaptiveOptions& options,
                              const EndOfRun& end = {}, bool asynchronous = false) {
  const AdaptiveProblem& problem = toy.problem();
  const Eigen::Index q = problem.measured.size();
  AdaptiveLoop loop;
  loop.runs.parameters.resize(0, static_cast<Eigen::Index>(problem.prior.size()));
  loop.runs.coordinates.resize(0, q);
  for (;;) {
    absl::StatusOr<AdaptiveDecision> decision = AdaptiveDecision{};
    if (asynchronous && MayOverlap(loop.memory)) {
      AdaptiveRuns seen = loop.runs;
      for (std::size_t i = 0; i < seen.end.size(); ++i) {
        if (seen.batch[i] + 1 == std::ssize(loop.memory)) seen.end[i] = RunEnd::kPending;
      }
      decision = DecideAdaptive(problem, seen, loop.memory, options);
    }
    if (!decision.ok() || decision->next.parameters.rows() == 0)
      decision = DecideAdaptive(problem, loop.runs, loop.memory, options);
    if (!decision.ok()) {
      loop.decision.stage = AdaptiveStage::kRefused;
      loop.decision.reason = "error: " + std::string(decision.status().message());
      return loop;
    }
    loop.decision = *std::move(decision);
    const AdaptiveBatch& next = loop.decision.next;
    if (next.parameters.rows() == 0) return loop;
    loop.memory.push_back(loop.decision.memory);
    AdaptiveRuns& runs = loop.runs;
    for (Eigen::Index i = 0; i < next.parameters.rows(); ++i) {
      const Eigen::Index n = runs.rows();
      const Eigen::VectorXd x = next.parameters.row(i).transpose();
      const int packing = next.packing[static_cast<std::size_t>(i)];
      const auto [how, reached] = end ? end(x) : std::pair(RunEnd::kComplete, q);
      Eigen::VectorXd y = toy.Run(x, packing, n);
      y.tail(q - reached).setConstant(std::nan(""));
      runs.parameters.conservativeResize(n + 1, Eigen::NoChange);
      runs.coordinates.conservativeResize(n + 1, Eigen::NoChange);
      runs.parameters.row(n) = x.transpose();
      runs.coordinates.row(n) = y.transpose();
      runs.packing.push_back(packing);
      runs.batch.push_back(static_cast<int>(loop.memory.size()) - 1);
      runs.end.push_back(how);
    }
  }
}

}  // namespace calib::inference
