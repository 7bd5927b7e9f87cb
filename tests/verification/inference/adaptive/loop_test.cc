// Adaptive calibrations of simulators whose posterior is known by brute force. How many seeds:
// $CALIB_SEEDS, from $CALIB_FIRST_SEED on; at most $CALIB_RUNS_PER_PARAMETER runs of each.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <iostream>

#include "tests/support/adaptive_toy.h"

namespace calib::inference {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

int FromEnvironment(const char* name, int otherwise) {
  const char* value = std::getenv(name);
  return value == nullptr ? otherwise : std::atoi(value);
}

struct Case {
  AdaptiveToy toy;
  ReferencePosterior reference;
};

PhiloxStream TruthStream(std::uint64_t seed) {
  return PhiloxStream({.seed = seed, .purpose = StreamPurpose::kTest, .iteration = 7, .sample = 0});
}

// y = A s, s standard normal; d + 4 coordinates.
Case LinearGaussian(int d, std::uint64_t seed) {
  const Index q = d + 4;
  PhiloxStream stream = TruthStream(seed);
  Eigen::MatrixXd a(q, d);
  for (double& value : a.reshaped()) value = 3 * stream.Normal();
  const std::vector<Prior> priors(static_cast<std::size_t>(d), {.kind = PriorKind::kNormal});
  Case result{
      .toy = AdaptiveToy(
          JointPrior(priors), [a](const VectorXd& x) -> VectorXd { return a * x; }, q, seed),
      .reference = {}};
  VectorXd truth(d);
  for (double& value : truth) value = stream.Normal();
  result.toy.MeasureAt(truth);
  // Its law of readings has mean zero and covariance V + A A^T; V from the likelihood's own matrix.
  const Eigen::MatrixXd v = result.toy.Covariance();
  const Eigen::MatrixXd gain = a.transpose() * v.inverse();
  const Eigen::MatrixXd covariance = (gain * a + Eigen::MatrixXd::Identity(d, d)).inverse();
  result.reference.mean = covariance * gain * result.toy.problem().measured;
  result.reference.sd = covariance.diagonal().cwiseSqrt();
  const Eigen::LLT<Eigen::MatrixXd> whole(v + a * a.transpose());
  result.reference.log_evidence =
      -0.5 * result.toy.problem().measured.dot(whole.solve(result.toy.problem().measured)) -
      whole.matrixLLT().diagonal().array().log().sum() -
      0.5 * static_cast<double>(q) * std::log(2 * std::numbers::pi);
  return result;
}

JointPrior Box(double min, double max, std::size_t d) {
  return std::vector<Prior>(d, {.kind = PriorKind::kUniform, .min = min, .max = max});
}

Case InTwo(const JointPrior& prior, const AdaptiveToy::Response& response, const VectorXd& truth,
           std::uint64_t seed) {
  Case result{.toy = AdaptiveToy(prior, response, 4, seed), .reference = {}};
  result.toy.MeasureAt(truth);
  result.reference = result.toy.ByQuadrature();
  return result;
}

// The product of both parameters is told to a few percent, their ratio hardly.
Case Ridge(std::uint64_t seed) {
  PhiloxStream stream = TruthStream(seed);
  const Eigen::Vector2d truth(0.8 + 0.7 * stream.Uniform(), 0.8 + 0.7 * stream.Uniform());
  return InTwo(
      Box(0.5, 2, 2),
      [](const VectorXd& x) -> VectorXd {
        const double product = x[0] * x[1];
        return Eigen::Vector4d(8 * product, 2 * product * product, 1.5 * (x[0] - x[1]),
                               6 * std::log(product));
      },
      truth, seed);
}

// The square of the first parameter, with a little of its sign.
Case TwoModes(std::uint64_t seed) {
  PhiloxStream stream = TruthStream(seed);
  const Eigen::Vector2d truth((stream.Uniform() < 0.5 ? -1 : 1) * (0.8 + 0.6 * stream.Uniform()),
                              2 * stream.Uniform() - 1);
  return InTwo(
      Box(-2, 2, 2),
      [](const VectorXd& x) -> VectorXd {
        return Eigen::Vector4d(4 * x[0] * x[0], 4 * x[1], 0.3 * x[0] + x[1] * x[1],
                               2 * x[0] * x[0] * x[1]);
      },
      truth, seed);
}

// The truth lies beside a bound of both parameters.
Case Edge(std::uint64_t seed) {
  PhiloxStream stream = TruthStream(seed);
  const Eigen::Vector2d truth(0.02 * stream.Uniform(), 0.98 + 0.02 * stream.Uniform());
  return InTwo(
      Box(0, 1, 2),
      [](const VectorXd& x) -> VectorXd {
        return Eigen::Vector4d(10 * x[0] + 3 * x[1], 8 * std::exp(x[1] - x[0]),
                               6 * x[1] * x[1] - 2 * x[0], 5 * std::sin(2 * x[0]) + x[1]);
      },
      truth, seed);
}

// Grains begin to slide: a jump along a line.
Case Jump(std::uint64_t seed) {
  PhiloxStream stream = TruthStream(seed);
  const Eigen::Vector2d truth(0.15 + 0.7 * stream.Uniform(), 0.15 + 0.7 * stream.Uniform());
  return InTwo(
      Box(0, 1, 2),
      [](const VectorXd& x) -> VectorXd {
        const double jump = x[0] + 0.5 * x[1] > 0.75 ? 1 : 0;
        return Eigen::Vector4d(8 * x[0] + 6 * jump, 6 * x[1] - 4 * jump, 5 * x[0] * x[1],
                               4 * (x[0] - x[1]));
      },
      truth, seed);
}

struct Score {
  double mean = 0, width = 0, evidence = 0;  // largest errors: sd, relative, nats
  double mean_stated = 0, stated = 0;        // standard errors of the means [sd], of the evidence
  VectorXd of_means{}, of_widths{};          // errors in standard errors as stated
  double of_evidence = 0;
  Index runs = 0;
  AdaptiveStage stage = AdaptiveStage::kFirst;
  bool MeetsMean() const { return mean < 0.15; }
  bool MeetsWidth() const { return width < 0.15; }
  bool MeetsEvidence() const { return evidence < std::max(0.3, stated); }
};

std::vector<Score> ScoresOf(const std::function<Case(std::uint64_t)>& make, int d,
                            const std::string& name, int seeds, bool asynchronous = false) {
  std::vector<Score> scores;
  const int first = FromEnvironment("CALIB_FIRST_SEED", 1);
  const int runs = FromEnvironment("CALIB_RUNS_PER_PARAMETER", 25) * d;
  for (int seed = first; seed < first + seeds; ++seed) {
    const Case one = make(static_cast<std::uint64_t>(seed));
    const AdaptiveLoop loop =
        Calibrate(one.toy, {.max_runs = runs, .seed = static_cast<std::uint64_t>(1000 + seed)}, {},
                  asynchronous);
    Score score{.runs = loop.runs.rows(), .stage = loop.decision.stage};
    if (loop.decision.posterior) {
      const AdaptivePosterior& p = *loop.decision.posterior;
      const ReferencePosterior& r = one.reference;
      score.mean = ((p.mean - r.mean).array() / r.sd.array()).abs().maxCoeff();
      score.width = (p.sd.array() / r.sd.array() - 1).abs().maxCoeff();
      score.evidence = std::abs(p.log_evidence - r.log_evidence);
      score.stated = p.log_evidence_error;
      score.of_means = (p.mean - r.mean).array() / p.mean_error.array();
      score.of_widths = (p.sd.array() / r.sd.array()).log() / p.log_sd_error.array();
      score.of_evidence = (p.log_evidence - r.log_evidence) / score.stated;
      score.mean_stated = (p.mean_error.array() / p.sd.array()).maxCoeff();
      std::cout << name << " seed " << seed << ": mean " << score.mean << " sd, said "
                << (p.mean_error.array() / p.sd.array()).maxCoeff() << "; width " << score.width
                << ", said " << p.log_sd_error.maxCoeff() << "; evidence "
                << p.log_evidence - r.log_evidence << ", said " << score.stated << "; "
                << score.runs << " runs, stage " << static_cast<int>(score.stage) << " verified "
                << loop.decision.verification.chance << ": " << loop.decision.reason << "\n";
    } else {
      score.mean = score.width = score.evidence = 1e9;
      std::cout << name << " seed " << seed << ": " << score.runs << " runs, "
                << loop.decision.reason << "\n";
    }
    scores.push_back(score);
  }
  const auto met = [&](const auto& which) {
    return std::count_if(scores.begin(), scores.end(), which);
  };
  std::cout << name << ": of " << seeds << " means "
            << met([](const Score& s) { return s.MeetsMean(); }) << ", widths "
            << met([](const Score& s) { return s.MeetsWidth(); }) << ", evidence "
            << met([](const Score& s) { return s.MeetsEvidence(); }) << ", converged "
            << met([](const Score& s) { return s.stage == AdaptiveStage::kConverged; })
            << ", all three or not converged " << met([](const Score& s) {
                 return s.stage != AdaptiveStage::kConverged ||
                        (s.MeetsMean() && s.MeetsWidth() && s.MeetsEvidence());
               })
            << "\n";
  const auto root_mean_square = [&](const auto& errors_of) {
    double sum = 0, count = 0;
    for (const Score& score : scores) {
      const VectorXd errors = errors_of(score);
      sum += errors.squaredNorm();
      count += static_cast<double>(errors.size());
    }
    return std::sqrt(sum / count);
  };
  Index runs_in_all = 0;
  for (const Score& score : scores) runs_in_all += score.runs;
  std::cout << name << ": " << static_cast<double>(runs_in_all) / seeds << " runs on average\n"
            << name << ": root mean square error in standard errors as stated: means "
            << root_mean_square([](const Score& s) { return s.of_means; }) << ", widths "
            << root_mean_square([](const Score& s) { return s.of_widths; }) << ", evidence "
            << root_mean_square([](const Score& s) { return VectorXd::Constant(1, s.of_evidence); })
            << "\n";
  return scores;
}

using MakeCase = std::function<Case(std::uint64_t)>;

MakeCase Linear(int d) {
  return [d](std::uint64_t seed) { return LinearGaussian(d, seed); };
}

// Of a few seeds: nothing far off, by three and a half standard errors as stated or by what DEM
// calibrations need not mind.
void ExpectNear(const std::vector<Score>& scores) {
  for (const Score& score : scores) {
    EXPECT_LT(score.mean, std::max(0.3, 3.5 * score.mean_stated));
    EXPECT_LT(score.width, 0.4);
    EXPECT_LT(score.evidence, std::max(0.3, 3.5 * score.stated));
  }
}

TEST(AdaptiveLoop, LinearGaussian) {
  ExpectNear(ScoresOf(Linear(2), 2, "linear2", 2));
  ExpectNear(ScoresOf(Linear(4), 4, "linear4", 1));
}
TEST(AdaptiveLoop, LinearGaussianWhileABatchRuns) {
  ExpectNear(ScoresOf(Linear(2), 2, "linear2 asynchronous", 2, true));
}
TEST(AdaptiveLoop, Ridge) { ExpectNear(ScoresOf(Ridge, 2, "ridge", 2)); }
TEST(AdaptiveLoop, TwoModes) { ExpectNear(ScoresOf(TwoModes, 2, "modes", 2)); }
TEST(AdaptiveLoop, EdgeOfThePrior) { ExpectNear(ScoresOf(Edge, 2, "edge", 2)); }

// Of twenty seeds at least so many meet each limit; fewer would be a change for the worse. The
// means of most cases are limited by the scatter: fifty runs on sixteen packings leave 0.09 sd at
// best.
struct Least {
  int means, widths, evidence;
};
void ExpectMostMeet(const MakeCase& make, int d, const std::string& name, const Least& least,
                    bool asynchronous = false) {
  const int seeds = FromEnvironment("CALIB_SEEDS", 20);
  const std::vector<Score> scores = ScoresOf(make, d, name, seeds, asynchronous);
  int means = 0, widths = 0, evidence = 0;
  for (const Score& score : scores) {
    means += score.MeetsMean() ? 1 : 0;
    widths += score.MeetsWidth() ? 1 : 0;
    evidence += score.MeetsEvidence() ? 1 : 0;
  }
  EXPECT_GE(means * 20, least.means * seeds);
  EXPECT_GE(widths * 20, least.widths * seeds);
  EXPECT_GE(evidence * 20, least.evidence * seeds);
}

TEST(AdaptiveLoopSlow, LinearGaussianOfTwo) {
  ExpectMostMeet(Linear(2), 2, "linear2", {.means = 7, .widths = 17, .evidence = 13});
}
TEST(AdaptiveLoopSlow, LinearGaussianOfFour) {
  ExpectMostMeet(Linear(4), 4, "linear4", {.means = 9, .widths = 18, .evidence = 15});
}
TEST(AdaptiveLoopSlow, LinearGaussianOfEight) {
  // The worst of eight means is 0.16 sd off in the middle.
  ExpectMostMeet(Linear(8), 8, "linear8", {.means = 1, .widths = 18, .evidence = 11});
}
TEST(AdaptiveLoopSlow, Ridge) {
  ExpectMostMeet(Ridge, 2, "ridge", {.means = 10, .widths = 13, .evidence = 13});
}
TEST(AdaptiveLoopSlow, TwoModes) {
  ExpectMostMeet(TwoModes, 2, "modes", {.means = 7, .widths = 14, .evidence = 13});
}
TEST(AdaptiveLoopSlow, EdgeOfThePrior) {
  ExpectMostMeet(Edge, 2, "edge", {.means = 8, .widths = 15, .evidence = 14});
}
// Batches chosen before the last has ended: the same limits.
TEST(AdaptiveLoopSlow, WhileABatchRuns) {
  const auto meet = [](const MakeCase& make, const std::string& name, const Least& least) {
    ExpectMostMeet(make, 2, name + " asynchronous", least, true);
  };
  meet(Linear(2), "linear2", {.means = 7, .widths = 17, .evidence = 13});
  meet(Ridge, "ridge", {.means = 10, .widths = 13, .evidence = 13});
  meet(TwoModes, "modes", {.means = 7, .widths = 14, .evidence = 13});
  meet(Edge, "edge", {.means = 8, .widths = 15, .evidence = 14});
}
// A jump is not seen as such: the emulator smooths it, which its stated errors do not hold.
TEST(AdaptiveLoopSlow, Jump) {
  ExpectMostMeet(Jump, 2, "jump", {.means = 2, .widths = 8, .evidence = 8});
}

// The decision after 150 runs of five parameters, whose cost is that of a batch.
TEST(AdaptiveLoopSlow, TakesSecondsABatchAtTheMost) {
  const Case one = LinearGaussian(5, 3);
  const AdaptiveLoop loop =
      Calibrate(one.toy, {.max_runs = 150, .mean_moves = 1e-9, .seed = 3});  // never settles
  ASSERT_GE(loop.runs.rows(), 144);
  const std::clock_t begin = std::clock();
  const auto decision =
      DecideAdaptive(one.toy.problem(), loop.runs, loop.memory, {.max_runs = 200, .seed = 3});
  const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  std::cout << "a decision after " << loop.runs.rows()
            << " runs, 5 parameters, 9 coordinates: " << seconds << " s of processor time\n";
  ASSERT_TRUE(decision.ok());
  EXPECT_LT(seconds, 5);
}

}  // namespace
}  // namespace calib::inference
