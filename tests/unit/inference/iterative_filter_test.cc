#include "inference/filter/iterative_filter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "inference/filter/parameter_summary.h"
#include "inference/sampling/philox.h"

namespace calib::inference {
namespace {

using testing::HasSubstr;

const std::vector<Prior>& Priors() {
  static const std::vector<Prior> priors{{.kind = PriorKind::kUniform, .min = 0, .max = 1},
                                         {.kind = PriorKind::kUniform, .min = 2, .max = 4}};
  return priors;
}

// Both parameters are read once, in two load steps.
DataSet Data(double sd) {
  DataSet data;
  data.readings.push_back({.observable = 0, .load_step = 0, .value = 0.4, .sd = sd});
  data.readings.push_back({.observable = 1, .load_step = 1, .value = 3.1, .sd = sd});
  return data;
}

Iteration FirstIteration(const FilterOptions& options, int n) {
  Iteration iteration;
  iteration.parameters = DrawSamples({}, Priors(), options, 0, n).value();
  iteration.predictions = iteration.parameters;
  return iteration;
}

std::string Message(const absl::Status& status) { return std::string(status.message()); }

TEST(DrawSamples, FirstIterationIsTheHaltonDesign) {
  const Eigen::MatrixXd samples = DrawSamples({}, Priors(), {}, 0, 3).value();
  EXPECT_NEAR(samples(0, 0), 0.5, 1e-15);
  EXPECT_NEAR(samples(2, 0), 0.75, 1e-15);
  EXPECT_NEAR(samples(1, 1), 2 + 2 * 2.0 / 3, 1e-15);
}

TEST(DrawSamples, SobolDesignFollowsTheSeed) {
  const auto draw = [](std::uint64_t seed) {
    return DrawSamples({}, Priors(), {.design = Design::kSobol, .seed = seed}, 0, 16).value();
  };
  EXPECT_EQ(draw(1), draw(1));
  EXPECT_NE(draw(1), draw(2));
}

TEST(DrawSamples, LaterIterationFromThePriorDoesNotRepeatTheDesign) {
  EXPECT_NE(DrawSamples({}, Priors(), {}, 0, 5).value(),
            DrawSamples({}, Priors(), {}, 1, 5).value());
}

TEST(DrawSamples, MixtureOutsideTheSupportIsRefused) {
  Proposal proposal;
  proposal.components.push_back(
      {.weight = 1, .mean = Eigen::Vector2d(50, 50), .covariance = Eigen::Matrix2d::Identity()});
  proposal.log_acceptance = -1000;
  EXPECT_EQ(DrawSamples(proposal, Priors(), {}, 1, 5).status().code(),
            absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(DrawSamples({}, Priors(), {}, 0, 0).status().code(),
            absl::StatusCode::kInvalidArgument);
}

TEST(LogImportance, SamplesOfThePriorHaveWeightOne) {
  const Iteration iteration = FirstIteration({}, 20);
  EXPECT_LE(LogImportance(Priors(), std::span(&iteration, 1)).cwiseAbs().maxCoeff(), 1e-14);
}

TEST(LogImportance, OutsideThePriorThereIsNoWeight) {
  Iteration iteration = FirstIteration({}, 20);
  iteration.log_proposal = Eigen::VectorXd::Zero(20);
  iteration.parameters(3, 0) = 1.5;
  EXPECT_EQ(LogImportance(Priors(), std::span(&iteration, 1))[3], -INFINITY);
}

// Weights are bounded by the reciprocal of the prior's share in all draws.
TEST(LogImportance, DefensiveShareBoundsTheWeights) {
  const FilterOptions options{.seed = 2};
  std::vector<Iteration> iterations{FirstIteration(options, 100)};
  Iteration second;
  second.proposal = FitProposal(Priors(), Data(0.05), options, iterations).value();
  second.parameters = DrawSamples(second.proposal, Priors(), options, 1, 300).value();
  second.predictions = second.parameters;
  iterations.push_back(second);
  const double share = (100 + 300 * options.defensive_share) / 400;
  const Eigen::VectorXd log_weights = LogImportance(Priors(), iterations);
  EXPECT_LE(log_weights.maxCoeff(), -std::log(share) + 1e-12);
  EXPECT_NEAR(log_weights.array().exp().mean(), 1, 0.15);
}

// n draws of one normal lump, in standard coordinates.
Eigen::MatrixXd Lump(int n, double a, double b, double sd) {
  Eigen::MatrixXd draws(n, 2);
  for (int i = 0; i < n; ++i) {
    PhiloxStream stream({.seed = 9,
                         .purpose = StreamPurpose::kDiagnosisNull,
                         .iteration = 0,
                         .sample = static_cast<std::uint64_t>(i)});
    for (int j = 0; j < 2; ++j) {
      draws(i, j) = Priors()[j].FromStandard((j == 0 ? a : b) + sd * stream.Normal());
    }
  }
  return draws;
}

// Mean kept, sd doubled.
TEST(FitProposalToDraws, SurroundsTheDraws) {
  const FilterOptions options{.seed = 3};
  const auto proposal = FitProposalToDraws(Priors(), options, Lump(2000, 0.5, -0.2, 0.1), 1);
  ASSERT_TRUE(proposal.ok()) << proposal.status();
  ASSERT_EQ(proposal->components.size(), 1);
  EXPECT_NEAR(proposal->components[0].mean[0], 0.5, 0.02);
  EXPECT_NEAR(proposal->components[0].mean[1], -0.2, 0.02);
  for (int j = 0; j < 2; ++j) {
    EXPECT_NEAR(std::sqrt(proposal->components[0].covariance(j, j)), 0.2, 0.02);
  }
  EXPECT_EQ(proposal->defensive_share, options.defensive_share);
  EXPECT_NEAR(proposal->log_acceptance, 0, 1e-3);
}

// The closest keep their sd and have half of the weight.
TEST(FitProposalToDraws, HalfOfItLiesAboutTheClosest) {
  const auto proposal = FitProposalToDraws(Priors(), {.seed = 3}, Lump(2000, 0.5, -0.2, 0.1), 1, {},
                                           Lump(200, 0.6, -0.3, 0.02));
  ASSERT_TRUE(proposal.ok()) << proposal.status();
  ASSERT_EQ(proposal->components.size(), 2);
  const auto& [wide, close] = std::pair(proposal->components[0], proposal->components[1]);
  EXPECT_NEAR(wide.weight, 0.5, 1e-9);
  EXPECT_NEAR(close.weight, 0.5, 1e-9);
  EXPECT_NEAR(std::sqrt(wide.covariance(0, 0)), 0.2, 0.02);
  EXPECT_NEAR(close.mean[0], 0.6, 0.005);
  EXPECT_NEAR(close.mean[1], -0.3, 0.005);
  EXPECT_NEAR(std::sqrt(close.covariance(0, 0)), 0.02, 0.004);
}

TEST(FitProposalToDraws, NothingToFitTo) {
  EXPECT_EQ(FitProposalToDraws(Priors(), {}, Eigen::MatrixXd(0, 2), 1).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(FitProposalToDraws(Priors(), {}, Eigen::MatrixXd::Zero(5, 3), 1).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(FitProposalToDraws(Priors(), {}, Lump(50, 0, 0, 1), 1, {}, Eigen::MatrixXd::Zero(5, 3))
                .status()
                .code(),
            absl::StatusCode::kInvalidArgument);
}

TEST(ComputePosterior, RowsMadeForAWiderPriorDoNotLowerTheEvidence) {
  const FilterOptions options;
  const Iteration all = FirstIteration(options, 400);
  std::vector<Prior> narrow = Priors();
  narrow[0].max = 0.5 * (narrow[0].min + narrow[0].max);
  Iteration inside = all;
  Eigen::Index kept = 0;
  for (Eigen::Index i = 0; i < 400; ++i) {
    if (all.parameters(i, 0) > narrow[0].max) continue;
    inside.parameters.row(kept) = all.parameters.row(i);
    inside.predictions.row(kept++) = all.predictions.row(i);
  }
  ASSERT_GT(kept, 100);
  ASSERT_LT(kept, 300);
  inside.parameters.conservativeResize(kept, Eigen::NoChange);
  inside.predictions.conservativeResize(kept, Eigen::NoChange);
  const auto one = ComputePosterior(narrow, Data(0.5), options, std::span(&all, 1));
  const auto other = ComputePosterior(narrow, Data(0.5), options, std::span(&inside, 1));
  ASSERT_TRUE(one.ok() && other.ok()) << one.status() << other.status();
  EXPECT_NEAR(one->log_evidence, other->log_evidence, 1e-12);
  EXPECT_NEAR(one->log_evidence_se, other->log_evidence_se, 1e-12);
  // With the density they were drawn from, each is a draw, of no weight there.
  Iteration known = all;
  known.log_proposal = Eigen::VectorXd::Zero(400);
  Iteration known_inside = inside;
  known_inside.log_proposal = Eigen::VectorXd::Zero(kept);
  const auto of_all = ComputePosterior(narrow, Data(0.5), options, std::span(&known, 1));
  const auto of_inside = ComputePosterior(narrow, Data(0.5), options, std::span(&known_inside, 1));
  ASSERT_TRUE(of_all.ok() && of_inside.ok());
  EXPECT_NEAR(of_all->log_evidence,
              of_inside->log_evidence + std::log(static_cast<double>(kept) / 400), 1e-12);
}

// They teach an emulator, and the weights know nothing of them.
TEST(ComputePosterior, RunsThatWereDrawnFromNoDensityHaveNoWeight) {
  const FilterOptions options;
  Iteration drawn = FirstIteration(options, 400);
  drawn.log_proposal = LogDensity({}, Priors(), drawn.parameters);
  Iteration with;
  with.parameters.resize(403, 2);
  with.parameters << Eigen::Vector2d(0.4, 3.1).transpose().replicate(3, 1), drawn.parameters;
  with.predictions = with.parameters;
  with.log_proposal = Eigen::VectorXd::Constant(403, INFINITY);
  with.log_proposal->tail(400) = *drawn.log_proposal;
  const auto one = ComputePosterior(Priors(), Data(0.2), options, std::span(&drawn, 1));
  const auto other = ComputePosterior(Priors(), Data(0.2), options, std::span(&with, 1));
  ASSERT_TRUE(one.ok() && other.ok()) << one.status() << other.status();
  EXPECT_EQ(other->log_weights.head(3).maxCoeff(), -INFINITY) << "though they fit best";
  EXPECT_TRUE(other->log_weights.tail(400).isApprox(one->log_weights));
  EXPECT_NEAR(other->log_evidence, one->log_evidence, 1e-12);
  EXPECT_NEAR(other->log_evidence_se, one->log_evidence_se, 1e-12);
  EXPECT_NEAR(other->parameters[0].mean, one->parameters[0].mean, 1e-12);
  EXPECT_THAT(other->warnings, testing::IsEmpty());
}

TEST(ComputePosterior, TinyNoiseStaysFinite) {
  const FilterOptions options;
  const Iteration iteration = FirstIteration(options, 100);
  const auto posterior = ComputePosterior(Priors(), Data(1e-9), options, std::span(&iteration, 1));
  ASSERT_TRUE(posterior.ok()) << posterior.status();
  EXPECT_TRUE(std::isfinite(posterior->log_evidence));
  EXPECT_NEAR(posterior->ess, 1, 1e-9);
  EXPECT_EQ(posterior->parameters[0].sd, 0);
  EXPECT_EQ(posterior->path.load_step, (std::vector<int>{0, 1}));
  EXPECT_THAT(posterior->warnings, testing::IsEmpty());
  EXPECT_THAT(posterior->degeneracy, HasSubstr("1 of 100 are effective"));
}

TEST(ComputePosterior, AllDivergedIsAnErrorThatSaysSo) {
  Iteration iteration = FirstIteration({}, 10);
  iteration.predictions.setConstant(NAN);
  const auto status = ComputePosterior(Priors(), Data(0.1), {}, std::span(&iteration, 1)).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(Message(status), HasSubstr("10 did not come to their ends"));
}

TEST(ComputePosterior, BadInputIsRefused) {
  Iteration iteration = FirstIteration({}, 10);
  const auto solve = [&](const DataSet& data, const FilterOptions& options) {
    return ComputePosterior(Priors(), data, options, std::span(&iteration, 1)).status().code();
  };
  EXPECT_EQ(solve({}, {}), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(solve(Data(-1), {}), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(solve(Data(1), {.ess_target = 1}), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(solve(Data(1), {.defensive_share = 1}), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(ComputePosterior(Priors(), Data(1), {}, {}).status().code(),
            absl::StatusCode::kFailedPrecondition);
  iteration.predictions.resize(10, 3);
  EXPECT_EQ(solve(Data(1), {}), absl::StatusCode::kInvalidArgument);
}

TEST(ComputePosterior, EffectiveSampleSizeTargetUsesTheLastIterationAndLabelsItself) {
  const FilterOptions options{.noise = NoiseMode::kEssTarget, .ess_target = 0.3};
  const std::vector<Iteration> iterations{FirstIteration(options, 50),
                                          FirstIteration(options, 100)};
  const auto posterior = ComputePosterior(Priors(), Data(0), options, iterations);
  ASSERT_TRUE(posterior.ok()) << posterior.status();
  ASSERT_EQ(posterior->log_weights.size(), 150);
  EXPECT_EQ(posterior->log_weights.head(50).maxCoeff(), -INFINITY);
  EXPECT_NEAR(posterior->ess, 30, 1e-6);
  EXPECT_GT(posterior->sigma.value(), 0);
  EXPECT_THAT(posterior->warnings, testing::ElementsAre(HasSubstr("tempers the data")));
  EXPECT_EQ(LogLikelihood(Data(0), options, iterations[0].predictions).status().code(),
            absl::StatusCode::kFailedPrecondition);
}

TEST(ComputePosterior, OneSurvivorIsNoPosteriorHoweverLargeSigmaIsTaken) {
  const FilterOptions options{.noise = NoiseMode::kEssTarget, .ess_target = 0.3};
  Iteration iteration = FirstIteration(options, 50);
  iteration.predictions.topRows(49).setConstant(NAN);
  const auto posterior = ComputePosterior(Priors(), Data(0), options, std::span(&iteration, 1));
  ASSERT_TRUE(posterior.ok()) << posterior.status();
  EXPECT_THAT(posterior->degeneracy, HasSubstr("Only 1 of 50 samples are effective"));
}

TEST(ComputePosterior, AtBoundWhenTheDataPullOutOfThePrior) {
  const FilterOptions options;
  const Iteration iteration = FirstIteration(options, 500);
  DataSet data = Data(0.05);
  data.readings[0].value = -0.1;
  const auto posterior = ComputePosterior(Priors(), data, options, std::span(&iteration, 1));
  EXPECT_TRUE(posterior->parameters[0].at_bound);
  EXPECT_FALSE(posterior->parameters[1].at_bound);
}

// A normal prior has no bound that could be pressed against: the posterior lies in its tail.
TEST(Summarize, WhereThePriorHasNoBoundThePosteriorLiesInItsTail) {
  const Prior open{.kind = PriorKind::kNormal, .mean = 2, .sd = 0.5};
  const Prior cut{.kind = PriorKind::kNormal, .min = 0, .max = 3.5, .mean = 2, .sd = 0.5};
  const Eigen::VectorXd weights = Eigen::VectorXd::Constant(101, -std::log(101.0));
  const auto at = [&](const Prior& prior, double middle) {
    return Summarize(prior, weights, Eigen::VectorXd::LinSpaced(101, middle - 0.2, middle + 0.2));
  };
  for (const double middle : {0.9, 3.2}) {
    EXPECT_FALSE(at(open, middle).at_bound);
    EXPECT_TRUE(InTail(open, at(open, middle)));
    EXPECT_TRUE(at(cut, middle).at_bound);
    EXPECT_FALSE(InTail(cut, at(cut, middle)));
  }
  EXPECT_FALSE(InTail(open, at(open, 2.2)));
  EXPECT_FALSE(at(cut, 2.2).at_bound);
  const Prior log{.kind = PriorKind::kLogNormal, .max = 9, .mean = 0, .sd = 0.5};
  EXPECT_TRUE(InTail(log, at(log, 0.3)));
  EXPECT_FALSE(InTail(log, at(log, 1)));
}

TEST(MeansConverged, RelativeToTheMeanOrToTheScaleOfThePrior) {
  Posterior before;
  before.parameters = {{.mean = 100, .sd = 0.1, .prior_sd = 20},
                       {.mean = 0.001, .sd = 0.01, .prior_sd = 20}};
  Posterior now = before;
  const FilterOptions options{.tolerance = 0.01};
  now.parameters[0].mean = 100.9;
  now.parameters[1].mean = 0.02;  // twenty times as much, but a thousandth of the prior's sd
  EXPECT_TRUE(MeansConverged(before, now, options));
  now.parameters[0].mean = 102;
  EXPECT_FALSE(MeansConverged(before, now, options));
  now.parameters[0].mean = NAN;
  EXPECT_FALSE(MeansConverged(before, now, options));
}

TEST(MeansConverged, AMoveWithinAThirdOfThePosteriorSdIsImmaterial) {
  Posterior before;
  before.parameters = {{.mean = 100, .sd = 9, .prior_sd = 200}};
  Posterior now = before;
  now.parameters[0].mean = 102.9;
  EXPECT_TRUE(MeansConverged(before, now, {.tolerance = 0.01}));
  EXPECT_FALSE(MeansConverged(before, now, {.noise = NoiseMode::kEssTarget, .tolerance = 0.01}));
  now.parameters[0].mean = 103.1;
  EXPECT_FALSE(MeansConverged(before, now, {.tolerance = 0.01}));
}

TEST(ViewOnline, CountsWhatEveryUndivergedSampleHasReached) {
  const FilterOptions options;
  DataSet data = Data(0.1);
  data.readings.push_back({.experiment = 1, .load_step = 0, .value = 1, .sd = 0.1});
  Eigen::MatrixXd predictions(3, 3);
  predictions << 0.4, NAN, 1, 0.6, 3.1, 1.05, NAN, NAN, NAN;
  const std::vector<char> diverged{0, 0, 1};
  // The second load step of experiment 0 is not common; experiment 1 is.
  const OnlineView view = ViewOnline(data, options, predictions, diverged);
  EXPECT_EQ(view.readings, 2);
  EXPECT_EQ(view.best, 0);
  EXPECT_NEAR(view.best_rms, 0, 1e-12);
  EXPECT_NEAR(view.ess, 1, 0.3);
}

// A worker that takes one sample after the other: the one under way has nothing yet.
TEST(ViewOnline, ThoseThatHaveEndedWhereOthersHaveHardlyBegun) {
  Eigen::MatrixXd predictions(4, 2);
  predictions << 0.4, 3.0, 0.4, 3.0, 3, 3, NAN, NAN;
  const std::vector<char> diverged{0, 0, 0, 0};
  const OnlineView view = ViewOnline(Data(0.1), {}, predictions, diverged);
  EXPECT_EQ(view.readings, 2);
  EXPECT_NEAR(view.ess, 2, 1e-6) << "two alike and one far off";
  EXPECT_LE(view.best, 1);
}

TEST(ViewOnline, BeforeAnythingHasArrived) {
  const Eigen::MatrixXd predictions = Eigen::MatrixXd::Constant(2, 2, NAN);
  const OnlineView view = ViewOnline(Data(0.1), {}, predictions, std::vector<char>{0, 0});
  EXPECT_EQ(view.readings, 0);
  EXPECT_EQ(view.best, -1);
  EXPECT_EQ(view.ess, 2);
  EXPECT_EQ(ViewOnline(Data(0.1), {}, predictions, std::vector<char>{1, 1}).ess, 0);
}

// Each column of a Latin hypercube has one point in each of n cells of equal prior probability; the
// symmetric one holds the mirror image of every point.
TEST(DrawSamples, LatinHypercubeDesignsStratifyThePrior) {
  const std::vector<Prior> priors = {
      {.kind = PriorKind::kUniform, .min = 2, .max = 4},
      {.kind = PriorKind::kLogUniform, .min = 1, .max = std::exp(1.0)}};
  for (const Design design : {Design::kLatinHypercube, Design::kSymmetricLatinHypercube}) {
    const auto drawn = DrawSamples({}, priors, {.design = design, .seed = 3}, 0, 12);
    ASSERT_TRUE(drawn.ok()) << drawn.status();
    Eigen::MatrixXd unit(12, 2);
    unit.col(0) = (drawn->col(0).array() - 2) / 2;
    unit.col(1) = drawn->col(1).array().log();
    for (Eigen::Index j = 0; j < 2; ++j) {
      std::vector<int> count(12, 0);
      for (const double u : unit.col(j)) ++count[static_cast<std::size_t>(u * 12)];
      EXPECT_EQ(count, std::vector<int>(12, 1));
    }
    if (design != Design::kSymmetricLatinHypercube) continue;
    for (Eigen::Index i = 0; i < 12; ++i) {
      const Eigen::RowVectorXd mirror = 1 - unit.row(i).array();
      EXPECT_LT((unit.rowwise() - mirror).rowwise().norm().minCoeff(), 1e-12);
    }
    EXPECT_EQ(*DrawSamples({}, priors, {.design = design, .seed = 3}, 0, 12), *drawn);
    EXPECT_NE(*DrawSamples({}, priors, {.design = design, .seed = 4}, 0, 12), *drawn);
  }
}

}  // namespace
}  // namespace calib::inference
