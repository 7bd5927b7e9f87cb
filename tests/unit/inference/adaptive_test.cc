#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "inference/adaptive/adaptive_decision.h"
#include "inference/numerics/matern_kernel.h"
#include "inference/sampling/sobol.h"
#include "tests/support/adaptive_toy.h"

namespace calib::inference {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using testing::HasSubstr;

JointPrior UnitSquare() {
  return std::vector<Prior>(2, {.kind = PriorKind::kUniform, .min = 0, .max = 1});
}

// Three coordinates of two parameters, bent.
AdaptiveToy Bent(std::uint64_t seed) {
  AdaptiveToy toy(
      UnitSquare(),
      [](const VectorXd& x) -> VectorXd {
        return Eigen::Vector3d(10 * x[0], 8 * x[1] * x[1], 6 * std::sqrt(0.1 + x[0] * x[1]));
      },
      3, seed);
  toy.MeasureAt(Eigen::Vector2d(0.4, 0.6));
  return toy;
}

// n runs that fill the prior, as one batch.
AdaptiveRuns Filled(const AdaptiveToy& toy, int n) {
  const AdaptiveBatch batch = FirstRuns(toy.problem(), n, 4, 3);
  AdaptiveRuns runs{.parameters = batch.parameters,
                    .packing = batch.packing,
                    .batch = std::vector<int>(static_cast<std::size_t>(n), 0),
                    .end = std::vector<RunEnd>(static_cast<std::size_t>(n), RunEnd::kComplete),
                    .coordinates = Eigen::MatrixXd(n, toy.problem().measured.size())};
  for (Index i = 0; i < n; ++i) {
    runs.coordinates.row(i) =
        toy.Run(batch.parameters.row(i).transpose(), batch.packing[static_cast<std::size_t>(i)], i)
            .transpose();
  }
  return runs;
}

const std::vector<AdaptiveMemory> kOneBatch(1);

TEST(MaternKernel, GradientByTheVarianceOfGroupsAgreesWithDifferences) {
  const Eigen::MatrixXd inputs = ScrambledSobol(20, 2, 1);
  const VectorXd outputs = (3 * inputs.col(0)).array().sin();
  std::vector<int> groups;
  for (int i = 0; i < 20; ++i) groups.push_back(i % 3);
  const KernelObjective objective(inputs, outputs, groups);
  VectorXd x(5), gradient(5), unused(5);
  x << 0.5, 0.2, -0.4, -3.0, -2.0;
  objective(x, gradient);
  for (Index j = 0; j < 5; ++j) {
    VectorXd above = x, below = x;
    above[j] += 1e-5;
    below[j] -= 1e-5;
    const double slope = (objective(above, unused) - objective(below, unused)) / 2e-5;
    EXPECT_NEAR(gradient[j], slope, 1e-6 * (1 + std::abs(slope))) << "hyper-parameter " << j;
  }
}

TEST(GaussianProcess, TellsDeparturesOfGroupsFromScatter) {
  constexpr int kRuns = 120, kGroups = 20;
  const Eigen::MatrixXd inputs = 2 * ScrambledSobol(kRuns, 2, 5);
  PhiloxStream stream({.seed = 4});
  VectorXd of_group(kGroups), outputs(kRuns);
  for (double& value : of_group) value = 0.5 * stream.Normal();
  std::vector<int> groups;
  for (int i = 0; i < kRuns; ++i) {
    groups.push_back(i % kGroups);
    outputs[i] =
        std::sin(2 * inputs(i, 0)) + inputs(i, 1) + of_group[i % kGroups] + 0.1 * stream.Normal();
  }
  const auto process =
      GaussianProcess::Fit(inputs, outputs, {.may_be_constant = false, .groups = groups});
  ASSERT_TRUE(process.ok());
  EXPECT_NEAR(std::sqrt(process->scatter_variance()), 0.1, 0.03);
  // Twenty groups show the variance to a third of itself.
  EXPECT_NEAR(std::sqrt(process->group_variance()), 0.5, 0.17);
  // The mean over groups is known no better than they allow.
  const GaussianProcessPrediction middle = process->Predict(Eigen::RowVector2d(1, 1));
  EXPECT_GT(middle.variance[0], 0.5 * process->group_variance() / kGroups);
  EXPECT_NEAR(middle.mean[0], std::sin(2.0) + 1, 4 * std::sqrt(middle.variance[0]));
}

TEST(GaussianProcess, CovarianceOfAPointWithItselfIsItsVariance) {
  const Eigen::MatrixXd inputs = ScrambledSobol(30, 2, 5), points = ScrambledSobol(7, 2, 9);
  const auto process = GaussianProcess::Fit(inputs, (4 * inputs.col(0)).array().sin());
  ASSERT_TRUE(process.ok());
  const VectorXd variance = process->Predict(points).variance;
  EXPECT_LT((process->Covariance(points, points).diagonal() - variance).norm(),
            1e-6 * (1e-3 + variance.norm()));
}

TEST(AdaptiveDesign, FillsThePriorOnBalancedPackingsWithRepeats) {
  const AdaptiveToy toy = Bent(1);
  const AdaptiveBatch batch = FirstRuns(toy.problem(), 36, 4, 8);
  ASSERT_EQ(batch.parameters.rows(), 36);
  std::vector<int> count(AdaptiveToy::kPackings, 0);
  for (int i = 0; i < 32; ++i) ++count[static_cast<std::size_t>(batch.packing[i])];
  EXPECT_EQ(*std::min_element(count.begin(), count.end()), 2);
  for (int r = 0; r < 4; ++r) {
    EXPECT_EQ(batch.parameters.row(32 + r), batch.parameters.row(r));
    EXPECT_NE(batch.packing[32 + r], batch.packing[r]);
  }
  for (Index j = 0; j < 2; ++j) {
    EXPECT_LT(batch.parameters.col(j).minCoeff(), 0.1);
    EXPECT_GT(batch.parameters.col(j).maxCoeff(), 0.9);
  }
}

TEST(AdaptiveDesign, RunsThatAreGivenStandForThePointsBesideThem) {
  const AdaptiveToy toy = Bent(1);
  const AdaptiveBatch alone = FirstRuns(toy.problem(), 24, 4, 8);
  // The third and the eighth point, and many runs in one place, which stand for one.
  AdaptiveBatch given{.parameters = Eigen::MatrixXd(12, 2), .packing = std::vector<int>(12, 3)};
  given.parameters.row(0) = alone.parameters.row(2);
  given.parameters.row(1) = alone.parameters.row(7).array() + 1e-3;
  for (Index i = 2; i < 12; ++i)
    given.parameters.row(i) = alone.parameters.row(11).array() + 1e-4 * static_cast<double>(i);
  const AdaptiveBatch beside = FirstRuns(toy.problem(), 24, 4, 8, given);
  ASSERT_EQ(beside.parameters.rows(), 21);
  EXPECT_EQ(beside.packing.size(), 21U);
  std::vector<Index> kept;
  for (Index i = 0; i < 20; ++i)
    if (i != 2 && i != 7 && i != 11) kept.push_back(i);
  EXPECT_EQ(beside.parameters.topRows(17), alone.parameters(kept, Eigen::all));
  for (int r = 0; r < 4; ++r) {
    EXPECT_EQ(beside.parameters.row(17 + r), beside.parameters.row(r));
    EXPECT_NE(beside.packing[17 + r], beside.packing[r]);
  }
}

TEST(AdaptiveDesign, WhereAllIsGivenRepeatsAreOfThose) {
  const AdaptiveToy toy = Bent(1);
  AdaptiveBatch given = FirstRuns(toy.problem(), 24, 4, 8);
  const AdaptiveBatch beside = FirstRuns(toy.problem(), 24, 4, 8, given);
  ASSERT_EQ(beside.parameters.rows(), 4);
  for (int r = 0; r < 4; ++r) {
    EXPECT_EQ(beside.parameters.row(r), given.parameters.row(r));
    EXPECT_NE(beside.packing[r], given.packing[r]);
  }
}

TEST(ResponseEmulator, FollowsABentModelAndItsScatter) {
  const AdaptiveToy toy = Bent(2);
  const auto emulator = ResponseEmulator::Fit(toy.problem(), Filled(toy, 60), 1);
  ASSERT_TRUE(emulator.ok());
  // Noise and scatter are diagonal, and of sum one but for what is learned of the scatter later.
  const VectorXd own = emulator->errors().Own();
  EXPECT_NEAR(own.mean(), 1, 0.15);
  EXPECT_NEAR(emulator->quality().calibration, 1, 0.5);
  EXPECT_GT(emulator->quality().explained, 0.9);
  EXPECT_LT(emulator->quality().over_repeats, 4);
  // Noise-free runs at new places are predicted within the claimed errors.
  const Eigen::MatrixXd x = ScrambledSobol(40, 2, 77);
  Eigen::MatrixXd model(40, 3);
  for (Index i = 0; i < 40; ++i)
    model.row(i) << 10 * x(i, 0), 8 * x(i, 1) * x(i, 1), 6 * std::sqrt(0.1 + x(i, 0) * x(i, 1));
  const EmulatorPrediction prediction = emulator->Predict(StandardRows(toy.problem().prior, x));
  const Eigen::ArrayXXd z =
      (emulator->Turned(model) - prediction.mean).array() / prediction.variance.array().sqrt();
  EXPECT_LT(z.square().mean(), 4);
  EXPECT_GT(z.square().mean(), 0.1);
}

// A constant does not follow a straight line; what could bend more predicts it worse.
TEST(ResponseEmulator, WeighsWhatPredictsRunsThatWereLeftOut) {
  AdaptiveToy toy(
      UnitSquare(),
      [](const VectorXd& x) -> VectorXd {
        return Eigen::Vector3d(10 * x[0], 8 * x[1], 5 * (x[0] + x[1]));
      },
      3, 5);
  const auto emulator = ResponseEmulator::Fit(toy.problem(), Filled(toy, 60), 1);
  ASSERT_TRUE(emulator.ok());
  const Eigen::MatrixXd& weights = emulator->weights();
  ASSERT_EQ(weights.rows(), 3);
  EXPECT_GE(weights.minCoeff(), 0);
  EXPECT_LT((weights.rowwise().sum().array() - 1).abs().maxCoeff(), 1e-12);
  EXPECT_TRUE((weights.col(1).array() > weights.col(4).array()).all()) << weights;
  EXPECT_EQ(weights.col(0).minCoeff(), 0) << weights;
}

// What parts differ by is in the variance, and in the covariance alike.
TEST(ResponseEmulator, ItsCovariancesAreOfItsVariances) {
  const AdaptiveToy toy = Bent(2);
  const auto emulator = ResponseEmulator::Fit(toy.problem(), Filled(toy, 40), 1);
  ASSERT_TRUE(emulator.ok());
  int parts = 0;
  for (const double weight : emulator->weights().reshaped()) parts += weight > 0.05 ? 1 : 0;
  ASSERT_GT(parts, 3) << "one part each: " << emulator->weights();
  const Eigen::MatrixXd at = StandardRows(toy.problem().prior, ScrambledSobol(20, 2, 5));
  const Eigen::MatrixXd variance = emulator->Predict(at).variance;
  const std::vector<Eigen::MatrixXd> all = emulator->Covariances(at, at);
  const std::vector<Eigen::MatrixXd> head = emulator->Covariances(at.topRows(3), at);
  ASSERT_EQ(all.size(), 3U);
  for (Index k = 0; k < 3; ++k) {
    const Eigen::MatrixXd& of = all[static_cast<std::size_t>(k)];
    EXPECT_TRUE(of.diagonal().isApprox(variance.col(k), 1e-6)) << k;
    EXPECT_TRUE(head[static_cast<std::size_t>(k)].isApprox(of.topRows(3), 1e-9)) << k;
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(of).eigenvalues().minCoeff(),
              -1e-8 * of.trace());
  }
}

TEST(ResponseEmulator, LearnsFromTheStagesThatEarlyEndsReached) {
  const AdaptiveToy toy = Bent(3);
  AdaptiveRuns runs = Filled(toy, 60);
  for (std::size_t i = 20; i < 50; i += 3) {
    runs.end[i] = RunEnd::kEarly;
    runs.coordinates.row(static_cast<Index>(i)).tail(1).setConstant(std::nan(""));
  }
  const auto with = ResponseEmulator::Fit(toy.problem(), runs, 1);
  for (RunEnd& end : runs.end) {
    if (end == RunEnd::kEarly) end = RunEnd::kFailed;
  }
  const auto without = ResponseEmulator::Fit(toy.problem(), runs, 1);
  ASSERT_TRUE(with.ok() && without.ok());
  EXPECT_EQ(with->quality().early, 10);
  EXPECT_EQ(with->quality().complete, 50);
  const Eigen::MatrixXd at = StandardRows(toy.problem().prior, ScrambledSobol(20, 2, 5));
  EXPECT_LT(with->Predict(at).variance.sum(), without->Predict(at).variance.sum());
}

TEST(KnownRegion, EndsWhereRunsFail) {
  const AdaptiveToy toy = Bent(4);
  AdaptiveRuns runs = Filled(toy, 60);
  for (Index i = 0; i < runs.rows(); ++i) {
    if (runs.parameters(i, 0) > 0.6) runs.end[static_cast<std::size_t>(i)] = RunEnd::kDiverged;
  }
  const auto region = KnownRegion::Fit(StandardRows(toy.problem().prior, runs.parameters), runs);
  ASSERT_TRUE(region.ok());
  EXPECT_TRUE(region->bounded());
  Eigen::MatrixXd places(2, 2);
  places << 0.3, 0.5, 0.85, 0.5;
  const VectorXd p =
      region->LogProbability(StandardRows(toy.problem().prior, places)).array().exp();
  EXPECT_GT(p[0], 0.95);
  EXPECT_LT(p[1], 0.05);
}

TEST(AdaptiveDecision, EvidenceFollowsTheUnitsOfTheCoordinates) {
  const AdaptiveToy toy = Bent(5);
  AdaptiveRuns runs = Filled(toy, 40);
  AdaptiveProblem problem = toy.problem();
  const auto first = DecideAdaptive(problem, runs, kOneBatch, {.seed = 2});
  const VectorXd scale = Eigen::Vector3d(2, 4, 0.5);
  runs.coordinates = runs.coordinates * scale.asDiagonal();
  problem.measured = scale.asDiagonal() * problem.measured;
  problem.noise = scale.asDiagonal() * problem.noise * scale.asDiagonal();
  const auto scaled = DecideAdaptive(problem, runs, kOneBatch, {.seed = 2});
  ASSERT_TRUE(first.ok() && scaled.ok() && first->posterior && scaled->posterior);
  EXPECT_NEAR(scaled->posterior->log_evidence,
              first->posterior->log_evidence - scale.array().log().sum(), 0.02);
  EXPECT_LT((scaled->posterior->mean - first->posterior->mean).norm(), 0.02);
}

TEST(AdaptiveDecision, NextRunsLieWhereTheDensityMayBeLargeAndOneExplores) {
  const AdaptiveToy toy = Bent(6);
  const AdaptiveRuns runs = Filled(toy, 30);
  const auto decision = DecideAdaptive(toy.problem(), runs, kOneBatch, {.seed = 2});
  ASSERT_TRUE(decision.ok() && decision->posterior);
  EXPECT_EQ(decision->stage, AdaptiveStage::kSearching);
  ASSERT_EQ(decision->next.parameters.rows(), 6);
  const Eigen::MatrixXd s = StandardRows(toy.problem().prior, decision->next.parameters);
  for (Index i = 0; i < 6; ++i) {
    EXPECT_TRUE(toy.problem().prior.InSupport(decision->next.parameters.row(i).transpose()));
    if (i == 5) continue;
    const VectorXd off = (s.row(i).transpose() - decision->posterior->mean).array() /
                         decision->posterior->sd.array();
    EXPECT_LT(off.norm(), 15) << i;
  }
  // 36 runs on sixteen packings: each has two at least.
  std::vector<int> count(AdaptiveToy::kPackings, 0);
  for (const int p : runs.packing) ++count[static_cast<std::size_t>(p)];
  for (const int p : decision->next.packing) ++count[static_cast<std::size_t>(p)];
  EXPECT_EQ(*std::min_element(count.begin(), count.end()), 2);
}

// After these as the only batch.
AdaptiveDecision DecisionAfter(const AdaptiveToy& toy, const AdaptiveRuns& runs) {
  auto decision = DecideAdaptive(toy.problem(), runs, kOneBatch, {.seed = 2});
  EXPECT_TRUE(decision.ok()) << decision.status();
  return decision.ok() ? *std::move(decision) : AdaptiveDecision{};
}

// The last batch of these is under way.
AdaptiveRuns WithPending(AdaptiveRuns runs, const AdaptiveBatch& batch, int number) {
  const Index n = runs.rows(), more = batch.parameters.rows();
  runs.parameters.conservativeResize(n + more, Eigen::NoChange);
  runs.parameters.bottomRows(more) = batch.parameters;
  runs.coordinates.conservativeResize(n + more, Eigen::NoChange);
  runs.coordinates.bottomRows(more).setConstant(std::nan(""));
  for (Index i = 0; i < more; ++i) {
    runs.packing.push_back(batch.packing[static_cast<std::size_t>(i)]);
    runs.batch.push_back(number);
    runs.end.push_back(RunEnd::kPending);
  }
  return runs;
}

TEST(AdaptiveDecision, PendingRunsCountAsMade) {
  const AdaptiveToy toy = Bent(6);
  const AdaptiveRuns runs = Filled(toy, 30);
  const AdaptiveDecision first = DecisionAfter(toy, runs);
  std::vector<AdaptiveMemory> memory = {{}, first.memory};
  EXPECT_EQ(memory[1].batches, 1);
  const auto second =
      DecideAdaptive(toy.problem(), WithPending(runs, first.next, 1), memory, {.seed = 2});
  ASSERT_TRUE(second.ok()) << second.status();
  EXPECT_EQ(second->memory.batches, 1) << "it knew no more than the one before";
  EXPECT_EQ(second->quality->complete, 30);
  ASSERT_EQ(second->next.parameters.rows(), 6);
  // The gain is that beyond what the pending runs will bring.
  EXPECT_LT(second->next.expected_gain, first.next.expected_gain);
  EXPECT_GT(second->next.expected_gain, 0);
  for (Index i = 0; i < 6; ++i) {
    for (Index j = 0; j < 6; ++j)
      EXPECT_NE(second->next.parameters.row(i), first.next.parameters.row(j));
  }
}

TEST(AdaptiveDecision, HasNotSettledByKnowingNothingNew) {
  const AdaptiveToy toy = Bent(6);
  const AdaptiveRuns runs = Filled(toy, 60);
  const AdaptiveDecision first = DecisionAfter(toy, runs);
  // Two batches are under way, chosen with one posterior.
  std::vector<AdaptiveMemory> memory = {{}, first.memory, first.memory, first.memory};
  AdaptiveRuns pending = runs;
  for (int number = 1; number <= 3; ++number) pending = WithPending(pending, first.next, number);
  const AdaptiveOptions wide{.mean_moves = 1e9, .width_moves = 1e9, .mean_error = 1e9, .seed = 2};
  const auto same = DecideAdaptive(toy.problem(), pending, memory, wide);
  ASSERT_TRUE(same.ok()) << same.status();
  EXPECT_EQ(same->stage, AdaptiveStage::kSearching);
  for (std::size_t k = 0; k < 4; ++k) memory[k].batches = static_cast<int>(k) - 3;
  const auto moved = DecideAdaptive(toy.problem(), pending, memory, wide);
  ASSERT_TRUE(moved.ok());
  EXPECT_EQ(moved->stage, AdaptiveStage::kVerifying);
}

TEST(AdaptiveDecision, WaitsForTheRunsThatJudge) {
  const AdaptiveToy toy = Bent(6);
  const AdaptiveRuns runs = Filled(toy, 30);
  const AdaptiveDecision first = DecisionAfter(toy, runs);
  std::vector<AdaptiveMemory> memory = {{}, first.memory};
  EXPECT_TRUE(MayOverlap(memory));
  EXPECT_FALSE(MayOverlap(kOneBatch));
  memory[1].stage = AdaptiveStage::kVerifying;
  EXPECT_FALSE(MayOverlap(memory));
  const auto too_early =
      DecideAdaptive(toy.problem(), WithPending(runs, first.next, 1), memory, {});
  EXPECT_THAT(std::string(too_early.status().message()), HasSubstr("before more runs have ended"));
}

TEST(AdaptiveDecision, IsTheSameBitForBit) {
  const AdaptiveToy toy = Bent(7);
  const AdaptiveRuns runs = Filled(toy, 30);
  const auto one = DecideAdaptive(toy.problem(), runs, kOneBatch, {.seed = 2});
  const auto two = DecideAdaptive(toy.problem(), runs, kOneBatch, {.seed = 2});
  ASSERT_TRUE(one.ok() && two.ok());
  EXPECT_EQ(one->next.parameters, two->next.parameters);
  EXPECT_EQ(one->posterior->log_weights, two->posterior->log_weights);
  EXPECT_EQ(one->posterior->log_evidence_error, two->posterior->log_evidence_error);
}

TEST(AdaptiveDecision, SaysHowManyRunsTheParametersTake) {
  AdaptiveToy toy(
      std::vector<Prior>(9, {.kind = PriorKind::kUniform, .min = 0, .max = 1}),
      [](const VectorXd& x) -> VectorXd { return x.head(3); }, 3, 1);
  const AdaptiveOptions options{.max_runs = 60};
  AdaptiveRuns none;
  none.parameters.resize(0, 9);
  const auto decision = DecideAdaptive(toy.problem(), none, {}, options);
  ASSERT_TRUE(decision.ok());
  EXPECT_EQ(decision->stage, AdaptiveStage::kRefused);
  EXPECT_THAT(decision->reason,
              HasSubstr("9 parameters take " + std::to_string(LeastMaxRuns(9, options))));
}

TEST(AdaptiveDecision, GivesNoPosteriorWhereAllFirstRunsFailed) {
  const AdaptiveToy toy = Bent(8);
  AdaptiveRuns runs = Filled(toy, 20);
  runs.coordinates.setConstant(std::nan(""));
  std::fill(runs.end.begin(), runs.end.end(), RunEnd::kDiverged);
  const auto decision = DecideAdaptive(toy.problem(), runs, kOneBatch, {});
  ASSERT_TRUE(decision.ok());
  EXPECT_EQ(decision->stage, AdaptiveStage::kRefused);
  EXPECT_FALSE(decision->posterior);
  EXPECT_THAT(decision->reason, HasSubstr("None of 20 runs is complete"));
}

TEST(AdaptiveDecision, SaysThatScatterSwallowsTheSignal) {
  AdaptiveToy toy(
      UnitSquare(),
      [](const VectorXd& x) -> VectorXd { return 0.01 * Eigen::Vector3d(x[0], x[1], 1); }, 3, 9, 3);
  toy.MeasureAt(Eigen::Vector2d(0.5, 0.5));
  const auto decision = DecideAdaptive(toy.problem(), Filled(toy, 30), kOneBatch, {});
  ASSERT_TRUE(decision.ok());
  EXPECT_EQ(decision->stage, AdaptiveStage::kRefused);
  EXPECT_FALSE(decision->posterior);
  EXPECT_TRUE(decision->propose_filter);
  EXPECT_THAT(decision->reason, HasSubstr("swallows the signal"));
}

TEST(AdaptiveDecision, SaysThatAModelCannotBeFollowedAndProposesTheFilter) {
  AdaptiveToy toy(
      UnitSquare(),
      [](const VectorXd& x) -> VectorXd {
        // Other numbers at each place, the same at the same one.
        PhiloxStream stream({.seed = static_cast<std::uint64_t>(1e15 * x[0] + 1e13 * x[1])});
        return 9 * Eigen::Vector3d(stream.Normal(), stream.Normal(), stream.Normal());
      },
      3, 10);
  toy.MeasureAt(Eigen::Vector2d(0.5, 0.5));
  const auto decision = DecideAdaptive(toy.problem(), Filled(toy, 40), kOneBatch, {});
  ASSERT_TRUE(decision.ok());
  EXPECT_EQ(decision->stage, AdaptiveStage::kRefused);
  EXPECT_TRUE(decision->propose_filter);
  EXPECT_THAT(decision->reason, HasSubstr("cannot follow"));
}

// A measurement off a bent model by as many sd in a direction that no parameter moves it.
AdaptiveToy OffTheModel(double distance) {
  AdaptiveToy toy(
      UnitSquare(),
      [](const VectorXd& x) -> VectorXd {
        VectorXd y(6);
        y << x[0], x[1], x[0] * x[1], std::sin(3 * x[0]), x[1] * x[1], 0;
        return 12 * y;
      },
      6, 12);
  toy.MeasureAt(Eigen::Vector2d(0.5, 0.5));
  toy.problem().measured[5] += distance;
  toy.problem().measured[3] -= distance;
  toy.problem().measured[2] += distance;
  return toy;
}

TEST(AdaptiveDecision, EndsWhereTheModelMissesTheReadingsAndNoRunHelps) {
  const AdaptiveLoop far = Calibrate(OffTheModel(40), {.max_runs = 150, .seed = 3});
  EXPECT_EQ(far.decision.stage, AdaptiveStage::kNotConverged);
  EXPECT_LT(far.runs.rows(), 100);
  EXPECT_THAT(far.decision.reason, HasSubstr("the model misses the readings by "));
  EXPECT_TRUE(far.decision.posterior);
  const AdaptiveLoop near = Calibrate(OffTheModel(3), {.max_runs = 150, .seed = 3});
  EXPECT_EQ(near.decision.stage, AdaptiveStage::kConverged) << near.decision.reason;
}

TEST(AdaptiveDecision, EndsWhereItHasSettledAndNoRunWouldMakeItsMeansKnown) {
  const AdaptiveLoop vain =
      Calibrate(OffTheModel(0), {.max_runs = 150, .mean_error = 0.02, .seed = 3});
  EXPECT_EQ(vain.decision.stage, AdaptiveStage::kNotConverged);
  EXPECT_LT(vain.runs.rows(), 100);
  EXPECT_TRUE(vain.decision.verification.passed);
  EXPECT_THAT(vain.decision.reason, HasSubstr("not all means would be known to 0.02 sd"));
  EXPECT_TRUE(vain.decision.posterior);
}

TEST(AdaptiveDecision, RefusesWhatDoesNotFit) {
  const AdaptiveToy toy = Bent(11);
  AdaptiveRuns runs = Filled(toy, 20);
  EXPECT_THAT(std::string(DecideAdaptive(toy.problem(), runs, {}, {}).status().message()),
              HasSubstr("0 earlier decisions"));
  runs.packing[3] = 99;
  EXPECT_THAT(std::string(DecideAdaptive(toy.problem(), runs, kOneBatch, {}).status().message()),
              HasSubstr("run 3 is on packing 99"));
  AdaptiveProblem problem = toy.problem();
  problem.noise(0, 0) = -1;
  EXPECT_FALSE(DecideAdaptive(problem, Filled(toy, 20), kOneBatch, {}).ok());
}

}  // namespace
}  // namespace calib::inference
