#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>
#include <map>
#include <string>

#include "inference/diagnosis/screen.h"
#include "inference/sampling/philox.h"
#include "inference/scatter/shrunk_covariance.h"

namespace calib::inference {
namespace {

constexpr int kReadings = 40;

// A straight line through the origin; the effects are a parabola, a sine and something like the
// parabola.
Eigen::VectorXd Curve(int kind) {
  Eigen::VectorXd curve(kReadings);
  for (int k = 0; k < kReadings; ++k) {
    const double x = (k + 1.0) / kReadings;
    curve[k] = kind == 0 ? x : kind == 1 ? x * x : kind == 2 ? std::sin(9 * x) : std::pow(x, 2.1);
  }
  return curve;
}

Eigen::VectorXd Noise(int seed) {
  PhiloxStream stream({.seed = static_cast<std::uint64_t>(seed)});
  Eigen::VectorXd noise(kReadings);
  for (double& value : noise) value = stream.Normal();
  return noise;
}

FittedModel Line(const Eigen::VectorXd& measured) {
  FittedModel model;
  Eigen::MatrixXd histories(2001, kReadings);
  for (int g = 0; g < 2001; ++g) histories.row(g) = (g - 1000) * 0.05 * Curve(0) - measured;
  model.histories = histories;
  model.covariance.setIdentity(kReadings, kReadings);
  model.parameters = 1;
  return model;
}

const std::vector<Signature> kCandidates = {{"parabola", {5 * Curve(1)}, false},
                                            {"sine", {2 * Curve(2)}, true},
                                            {"power", {5 * Curve(3)}, false}};

TEST(Diagnosis, NothingMissingIsAdequateAtTheStatedRate) {
  int adequate = 0;
  int flagged = 0;
  constexpr int kDraws = 100;
  for (int seed = 0; seed < kDraws; ++seed) {
    const FittedModel model = Line(12 * Curve(0) + Noise(seed));
    adequate += TestAdequacy(model)->p_value >= 0.01 ? 1 : 0;
    const auto scores = Screen(model, kCandidates, {.simulations = 200});
    flagged += scores->front().adjusted < 0.05 ? 1 : 0;
  }
  EXPECT_GE(adequate, 96);
  EXPECT_LE(flagged, 12);
}

TEST(Diagnosis, PointsThatTheReadingsDoNotExcludeLieAroundTheClosest) {
  const FittedModel model = Line(12 * Curve(0) + Noise(3));
  const auto closest = TestAdequacy(model)->best;
  const double steps = std::sqrt(3.841) / (0.05 * Curve(0).norm());  // of the 95 % interval
  const auto near = *PointsNotExcluded(model, 3);
  ASSERT_EQ(near.size(), 3U);
  double before = 0;
  for (const Eigen::Index point : near) {
    const auto off = static_cast<double>(std::abs(point - closest));
    EXPECT_LE(off, steps + 1);
    EXPECT_GT(off, before);
    before = off;
  }
  EXPECT_GT(before, 0.6 * steps);
  EXPECT_EQ(PointsNotExcluded(model, 1)->size(), 1U);
  EXPECT_LT(PointsNotExcluded(model, 2001)->size(), 2 * steps + 1);
}

// A misfit that lasts is a small part of all that scatters, and the whole of what lasts.
TEST(Diagnosis, AMisfitInAKnownShapeIsSeenBeforeItIsLargeAmongAllReadings) {
  constexpr int kDraws = 100;
  constexpr double kSize = 1.4;  // sd of a reading, over a quarter of them
  Eigen::MatrixXd quarters = Eigen::MatrixXd::Zero(kReadings, 4);
  for (int k = 0; k < kReadings; ++k) quarters(k, 4 * k / kReadings) = 1;
  int found[2] = {0, 0};
  int alarms = 0;
  for (int seed = 0; seed < kDraws; ++seed) {
    for (const bool shaped : {false, true}) {
      for (const bool wrong : {false, true}) {
        FittedModel model =
            Line(12 * Curve(0) + (wrong ? kSize : 0) * quarters.col(1) + Noise(seed));
        model.draws.resize(200, kReadings);
        for (int s = 0; s < 200; ++s) model.draws.row(s) = Noise(1000 + s);
        if (shaped) model.shapes = {quarters};
        const auto adequacy = TestAdequacy(model);
        ASSERT_TRUE(adequacy.ok()) << adequacy.status();
        EXPECT_EQ(adequacy->p_shapes.has_value(), shaped);
        const bool rejected = adequacy->p_value < 0.01;
        if (wrong) found[shaped ? 1 : 0] += rejected ? 1 : 0;
        if (!wrong && shaped) alarms += rejected ? 1 : 0;
      }
    }
  }
  std::cout << "found " << found[0] << " of " << kDraws << " by all readings, " << found[1]
            << " with the shapes; " << alarms << " false alarms\n";
  EXPECT_GE(found[1], found[0] + 25);
  EXPECT_LE(alarms, 4);
  FittedModel model = Line(12 * Curve(0));
  model.draws = Eigen::MatrixXd::Random(50, kReadings);
  model.shapes = {Eigen::MatrixXd::Ones(kReadings - 1, 1)};
  EXPECT_FALSE(TestAdequacy(model).ok());
}

// The errors of the measurements have standard deviation `sd`, the covariance says one.
FittedModel LineWithDraws(const Eigen::VectorXd& measured, double sd) {
  FittedModel model = Line(measured);
  model.draws.resize(400, kReadings);
  for (int s = 0; s < 400; ++s) model.draws.row(s) = sd * Noise(1000 + s);
  return model;
}

TEST(Diagnosis, DrawsOfAMeasurementSayHowLargeDistancesAre) {
  constexpr double kCautious = 0.5;
  constexpr double kBold = 2;
  for (const double sd : {kCautious, kBold}) {
    int adequate = 0;
    int flagged = 0;
    double sum = 0;
    for (int seed = 0; seed < 100; ++seed) {
      const FittedModel model = LineWithDraws(12 * Curve(0) + sd * Noise(seed), sd);
      const auto adequacy = TestAdequacy(model);
      adequate += adequacy->p_value >= 0.01 ? 1 : 0;
      sum += adequacy->p_value;
      EXPECT_NEAR(adequacy->degrees / (sd * sd * (kReadings - 1)), 1, 0.05);
      flagged += Screen(model, kCandidates, {.simulations = 200})->front().adjusted < 0.05 ? 1 : 0;
    }
    EXPECT_GE(adequate, 96) << sd;
    EXPECT_NEAR(sum / 100, 0.5, 4 * std::sqrt(1.0 / 12 / 100)) << sd;  // uniform, 100 of them
    EXPECT_LE(flagged, 12) << sd;
  }
  // A misfit that a cautious covariance alone would hide.
  const Eigen::VectorXd measured = 12 * Curve(0) + 0.8 * Curve(2) + kCautious * Noise(1);
  EXPECT_GT(TestAdequacy(Line(measured))->p_value, 0.5);
  EXPECT_LT(TestAdequacy(LineWithDraws(measured, kCautious))->p_value, 0.01);
  // And one that is found as far away as it is in units of the errors, not of the covariance.
  const auto narrow = Screen(LineWithDraws(12 * Curve(0), kCautious), kCandidates);
  const auto plain = Screen(Line(12 * Curve(0)), kCandidates);
  for (const Score& score : *narrow) {
    for (const Score& other : *plain) {
      if (score.name != other.name || !std::isfinite(other.detectable)) continue;
      EXPECT_NEAR(score.detectable / other.detectable, kCautious, 0.1) << score.name;
    }
  }
}

// Scatter of one packing: three times the noise along a sine, and as much as the noise elsewhere.
Eigen::VectorXd Scatter(int seed) {
  return Noise(seed) + 3 * Noise(seed + 50000)[0] * Curve(2).normalized();
}

// Measurements and runs on packings, five on each of eight; the covariance is estimated from the
// runs, from which measurements are drawn as well.
FittedModel LineWithScatter(const Eigen::VectorXd& measured, int seed, bool without_own) {
  constexpr int kRuns = 40;
  constexpr int kPackings = 8;
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(kReadings, kReadings);
  Eigen::MatrixXd departures(kRuns, kReadings);
  std::vector<int> packing;
  for (int r = 0; r < kRuns; ++r) {
    departures.row(r) = Scatter(1000 * (seed + 1) + r);
    packing.push_back(r % kPackings);
  }
  FittedModel model = Line(measured);
  model.covariance =
      identity + ShrinkCovariance(departures, packing, identity, 2 * identity).covariance;
  model.draws.resize(400, kReadings);
  for (int s = 0; s < 400; ++s) {
    model.draws.row(s) = Noise(1000 * (seed + 1) + 100 + s) + departures.row(s % kRuns).transpose();
    if (without_own) model.group.push_back(s % kRuns % kPackings);
  }
  for (int g = 0; without_own && g < kPackings; ++g) {
    std::vector<int> rows;
    std::vector<int> others;
    for (int r = 0; r < kRuns; ++r) {
      if (r % kPackings == g) continue;
      rows.push_back(r);
      others.push_back(r % kPackings);
    }
    model.without.push_back(
        identity +
        ShrinkCovariance(departures(rows, Eigen::all), others, identity, 2 * identity).covariance);
  }
  return model;
}

TEST(Diagnosis, DrawsAreJudgedByACovarianceThatDoesNotKnowTheirRun) {
  double own = 0;
  double others = 0;
  int adequate = 0;
  constexpr int kMeasurements = 100;
  for (int seed = 0; seed < kMeasurements; ++seed) {
    const Eigen::VectorXd measured = 12 * Curve(0) + Noise(seed) + Scatter(500000 + seed);
    own += TestAdequacy(LineWithScatter(measured, seed, false))->p_value / kMeasurements;
    const double p_value = TestAdequacy(LineWithScatter(measured, seed, true))->p_value;
    others += p_value / kMeasurements;
    adequate += p_value >= 0.01 ? 1 : 0;
  }
  EXPECT_LT(own, 0.4);  // what the groups are for
  EXPECT_NEAR(others, 0.5, 4 * std::sqrt(1.0 / 12 / kMeasurements));
  EXPECT_GE(adequate, 95);
  FittedModel wrong = LineWithScatter(12 * Curve(0), 0, true);
  wrong.group.back() = 8;
  EXPECT_FALSE(TestAdequacy(wrong).ok());
}

TEST(Diagnosis, PresentEffectComesFirstWithItsAmplitude) {
  const FittedModel model = Line(12 * Curve(0) + 30 * Curve(2) + Noise(1));
  EXPECT_LT(TestAdequacy(model)->p_value, 1e-6);
  const auto scores = Screen(model, kCandidates, {.max_amplitude = 20});
  ASSERT_TRUE(scores.ok());
  EXPECT_EQ(scores->front().name, "sine");
  EXPECT_NEAR(scores->front().amplitude, 15, 0.5);
  EXPECT_LT(scores->front().adjusted, 1e-6);
  EXPECT_GT(scores->front().explained, 0.95);
}

TEST(Diagnosis, OneSidedEffectIsNotUsedBackwards) {
  const auto scores = Screen(Line(40 * Curve(0) - 20 * Curve(1) + Noise(2)), kCandidates);
  for (const Score& score : *scores) {
    if (score.name != "sine") {
      EXPECT_GE(score.amplitude, 0);
      EXPECT_LT(score.gain, 1);
    }
  }
}

TEST(Diagnosis, ParallelSignaturesAreConfusable) {
  const auto scores = Screen(Line(12 * Curve(0) + 30 * Curve(1) + Noise(3)), kCandidates);
  ASSERT_EQ(scores->size(), 3U);
  EXPECT_NE(scores->front().name, "sine");
  ASSERT_EQ(scores->front().confusable_with.size(), 1U);
  EXPECT_NE(scores->front().confusable_with.front(), "sine");
}

TEST(Diagnosis, ParallelSignaturesAreToldApartByALargeMisfit) {
  const auto scores = Screen(Line(12 * Curve(0) + 30000 * Curve(1) + Noise(3)), kCandidates,
                             {.max_amplitude = 1e5});
  ASSERT_EQ(scores->size(), 3U);
  EXPECT_TRUE(scores->front().confusable_with.empty());
}

TEST(Diagnosis, NothingIsExplainedWhereNothingIsMissing) {
  double most = 0;
  for (int seed = 0; seed < 20; ++seed) {
    const auto scores = Screen(Line(12 * Curve(0) + Noise(seed)), kCandidates);
    for (const Score& score : *scores) most = std::max(most, score.explained);
  }
  EXPECT_LT(most, 0.9);  // of any chance
}

TEST(Diagnosis, TheNearestOfConfusableSignaturesComesFirst) {
  std::vector<Signature> candidates = {{"wavy", {5 * Curve(1) + 0.1 * Curve(2)}, false}};
  candidates.insert(candidates.end(), kCandidates.begin(), kCandidates.end());
  const auto scores = Screen(Line(12 * Curve(0) + 30 * Curve(1) + Noise(3)), candidates);
  for (const Score& score : *scores) {
    for (std::size_t k = 1; k < score.confusable_with.size(); ++k) {
      EXPECT_LE(score.angles.at(score.confusable_with[k - 1]),
                score.angles.at(score.confusable_with[k]));
    }
    // In the order of the candidates it would be "wavy".
    if (score.name != "parabola") continue;
    ASSERT_EQ(score.confusable_with.size(), 2U);
    EXPECT_EQ(score.confusable_with.front(), "power");
  }
}

TEST(Diagnosis, SignatureThatTheParametersImitateIsNotDetectable) {
  const auto scores = Screen(Line(12 * Curve(0) + Noise(4)), {{"line", {3 * Curve(0)}, true}});
  EXPECT_GT(scores->front().detectable, 10);
  const auto sine = Screen(Line(12 * Curve(0) + Noise(4)), {{"sine", {2 * Curve(2)}, true}});
  EXPECT_LT(sine->front().detectable, 1);
}

// Of an effect that may be present in two ways, the longer of which comes first.
TEST(Diagnosis, WhatIsDetectableIsFoundNineTimesInTen) {
  const std::vector<Signature> candidates = {{"two ways", {4 * Curve(2), 0.5 * Curve(1)}, true},
                                             {"power", {5 * Curve(3)}, false}};
  const auto two_ways = [&candidates](const Eigen::VectorXd& measured) {
    const auto scores = Screen(Line(measured), candidates);
    return *std::find_if(scores->begin(), scores->end(),
                         [](const Score& score) { return score.name == "two ways"; });
  };
  const Score weakest = two_ways(12 * Curve(0));
  EXPECT_EQ(weakest.detectable_difference, 0);
  int found = 0;
  constexpr int kDraws = 100;
  for (int seed = 0; seed < kDraws; ++seed) {
    const Eigen::VectorXd effect = weakest.detectable * candidates[0].differences[0];
    found += two_ways(12 * Curve(0) + effect + Noise(200 + seed)).p_value < 0.01 / 2 ? 1 : 0;
  }
  EXPECT_NEAR(found, 90, 8);  // of one without the two signs and ways: 80 expected
}

// Differences of single runs: an effect, as strong as said, and chance that has nothing to do with
// it.
TEST(Diagnosis, ChanceInDifferencesOfRunsIsNotTakenForAnEffect) {
  const FittedModel model = Line(12 * Curve(0));
  std::vector<double> of_effect;
  int unseen = 0;
  constexpr int kDraws = 40;
  for (int seed = 0; seed < kDraws; ++seed) {
    const Eigen::VectorXd first = 2 * Noise(100 + 2 * seed);
    const Eigen::VectorXd second = 2 * Noise(101 + 2 * seed);
    const auto scores = Screen(model,
                               {{"sine", {Curve(2) + first, 3 * Curve(2) + second}, true, {1, 3}},
                                {"nothing", {first, second}, true, {1, 3}}},
                               {.simulations = 50});
    for (const Score& score : *scores) {
      if (score.name == "sine") of_effect.push_back(score.detectable);
      if (score.name == "nothing") unseen += std::isinf(score.detectable) ? 1 : 0;
    }
  }
  const auto exact = Screen(model, {{"sine", {3 * Curve(2)}, true, {}}}, {.simulations = 50});
  std::sort(of_effect.begin(), of_effect.end());
  // Two candidates of two differences instead of one raise the level that must be reached a little.
  constexpr int kHalf = kDraws / 2;
  EXPECT_NEAR(of_effect[kHalf] / exact->front().detectable, 1.1, 0.15);
  EXPECT_NEAR(unseen, kHalf, 12);  // a product of chance is as often positive
}

TEST(Diagnosis, BetterModelHasTheAdvantage) {
  const Eigen::VectorXd measured = 12 * Curve(0) + 30 * Curve(2) + Noise(5);
  FittedModel extended = Line(measured);
  extended.histories = extended.histories.Values().rowwise() + 30 * Curve(2).transpose();
  const auto advantage = Compare(extended, Line(measured));
  EXPECT_GT(advantage->nats, 2 * advantage->sd);
  EXPECT_EQ(Compare(extended, extended)->nats, 0);
}

// Two halves of a straight line predict each other; a line through the origin fitted to one half of
// a parabola misses the other, and a model of many bumps that can follow each half alone does too.
// The line with a sine of any amplitude.
FittedModel LineAndSine(const Eigen::VectorXd& measured) {
  FittedModel model = Line(measured);
  const Eigen::MatrixXd line = model.histories.Values();
  constexpr int kSlopes = 61;  // from 5 to 20
  constexpr int kAmplitudes = 41;
  constexpr int kMiddle = kAmplitudes / 2;
  Eigen::MatrixXd histories(kSlopes * kAmplitudes, kReadings);
  for (int g = 0; g < kSlopes; ++g) {
    for (int a = 0; a < kAmplitudes; ++a) {
      histories.row(g * kAmplitudes + a) =
          line.row(1100 + 5 * g) + 0.2 * (a - kMiddle) * Curve(2).transpose();
    }
  }
  model.histories = histories;
  model.parameters = 2;
  return model;
}

TEST(Diagnosis, GainOfAnExtensionIsAsRareAsItsPValueSays) {
  int rare = 0;
  double sum = 0;
  constexpr int kDraws = 100;
  for (int seed = 0; seed < kDraws; ++seed) {
    const Eigen::VectorXd measured = 12 * Curve(0) + 2 * Noise(seed);
    const auto p_value = SignificanceOfGain(LineWithDraws(measured, 2), LineAndSine(measured));
    ASSERT_TRUE(p_value.ok());
    rare += *p_value < 0.05 ? 1 : 0;
    sum += *p_value;
  }
  EXPECT_LE(rare, 12);
  EXPECT_NEAR(sum / kDraws, 0.5, 0.12);
  const Eigen::VectorXd measured = 12 * Curve(0) + 3 * Curve(2) + 2 * Noise(1);
  EXPECT_LT(*SignificanceOfGain(LineWithDraws(measured, 2), LineAndSine(measured)), 1e-4);
  EXPECT_FALSE(SignificanceOfGain(Line(measured), LineAndSine(measured)).ok());  // no draws
  EXPECT_FALSE(SignificanceOfGain(LineWithDraws(measured, 2), Line(measured)).ok());
}

// Measurements that scatter twice as far as their covariance says, without any effect: beyond what
// the simulations can count, too, small p values have to be as rare as they say.
TEST(Diagnosis, SmallPValuesOfTheScreenAreAsRareAsTheySay) {
  constexpr int kMeasurements = 300;
  const std::vector<Signature> candidates = {{"one side", {2 * Curve(2)}, false},
                                             {"both sides", {2 * Curve(2), 5 * Curve(2)}, true}};
  std::map<std::string, std::array<int, 2>> below;  // 0.01, 0.001
  for (int seed = 0; seed < kMeasurements; ++seed) {
    const auto scores =
        Screen(LineWithDraws(12 * Curve(0) + 2 * Noise(5000 + seed), 2), candidates);
    ASSERT_TRUE(scores.ok());
    for (const Score& score : *scores) {
      below[score.name][0] += score.p_value < 0.01 ? 1 : 0;
      below[score.name][1] += score.p_value < 0.001 ? 1 : 0;
    }
  }
  for (const auto& [name, count] : below) {
    EXPECT_LE(count[0], 10) << name;  // four standard deviations above three, and above a third:
    EXPECT_LE(count[1], 3) << name;
    EXPECT_GE(count[0], 1) << name;
  }
}

TEST(Diagnosis, AFewReadingsSayLittleOfTheirOwnChance) {
  FittedModel one = Line(12 * Curve(0));
  one.histories = Eigen::MatrixXd::Constant(1, 6, 1.0);
  one.covariance = Eigen::MatrixXd::Identity(6, 6);
  FittedModel other = one;
  other.histories = Eigen::MatrixXd{{3, 1, 2, 1, 1.5, 1}};
  const auto advantage = Compare(one, other);
  ASSERT_TRUE(advantage.ok());
  // Terms 4, 0, 1.5, 0, 0.625, 0: their sum and sqrt(n) times their standard deviation.
  EXPECT_DOUBLE_EQ(advantage->nats, 6.125);
  EXPECT_NEAR(advantage->sd, 3.8556, 1e-4);
  one.histories = other.histories = Eigen::MatrixXd::Constant(1, 1, 1.0);
  one.covariance = other.covariance = Eigen::MatrixXd::Identity(1, 1);
  EXPECT_TRUE(std::isinf(Compare(one, other)->sd));
}

TEST(Diagnosis, LeftOutReadingsAreMissedByAWrongModel) {
  std::vector<int> halves(kReadings, 0);
  std::fill(halves.begin() + kReadings / 2, halves.end(), 1);
  EXPECT_NEAR(LeftOutError(Line(12 * Curve(0) + Noise(3)), halves).value(), 1, 0.3);
  EXPECT_GT(LeftOutError(Line(30 * Curve(1) + Noise(3)), halves).value(), 3);

  FittedModel bumps = Line(12 * Curve(0));
  Eigen::MatrixXd histories = Eigen::MatrixXd::Constant(2, kReadings, 10);
  histories.row(0).head(kReadings / 2).setZero();
  histories.row(1).tail(kReadings / 2).setZero();
  bumps.histories = histories;
  EXPECT_NEAR(LeftOutError(bumps, halves).value(), 10, 1e-9);
  EXPECT_FALSE(LeftOutError(bumps, std::vector<int>(kReadings, 0)).ok());
}

// Two shapes instead of forty numbers per point: the same answers.
TEST(Diagnosis, HistoriesOfFewShapesAreJudgedLikeTheirValues) {
  const Eigen::VectorXd measured = 12 * Curve(0) + 3 * Curve(2) + Noise(2);
  const FittedModel as_they_are = LineWithScatter(measured, 3, true);
  FittedModel of_shapes = as_they_are;
  Eigen::MatrixXd shapes(kReadings, 2);
  shapes << -measured, Curve(0);
  Eigen::MatrixXd coefficients = Eigen::MatrixXd::Ones(2, 2001);
  coefficients.row(1).setLinSpaced(-50, 50);
  of_shapes.histories = {shapes, coefficients};
  ASSERT_LT((of_shapes.histories.Values() - as_they_are.histories.Values()).norm(), 1e-9);
  EXPECT_NEAR(of_shapes.histories.Rms(1234), as_they_are.histories.Rms(1234), 1e-9);

  const auto adequacy = TestAdequacy(of_shapes);
  const auto expected = TestAdequacy(as_they_are);
  EXPECT_EQ(adequacy->best, expected->best);
  EXPECT_NEAR(adequacy->chi2, expected->chi2, 1e-8);
  EXPECT_NEAR(adequacy->degrees, expected->degrees, 1e-8);
  EXPECT_NEAR(adequacy->p_value, expected->p_value, 1e-9);
  const auto scores = Screen(of_shapes, kCandidates);
  const auto values = Screen(as_they_are, kCandidates);
  for (std::size_t c = 0; c < kCandidates.size(); ++c) {
    EXPECT_EQ((*scores)[c].name, (*values)[c].name);
    EXPECT_NEAR((*scores)[c].gain, (*values)[c].gain, 1e-8);
    EXPECT_NEAR((*scores)[c].p_value, (*values)[c].p_value, 1e-8);
    EXPECT_NEAR((*scores)[c].detectable, (*values)[c].detectable, 1e-8);
  }
  FittedModel extended = of_shapes;  // with a sine, a point in four
  shapes.conservativeResize(Eigen::NoChange, 3);
  shapes.col(2) = 5 * Curve(2);
  coefficients.conservativeResize(3, Eigen::NoChange);
  for (Eigen::Index g = 0; g < 2001; ++g) coefficients(2, g) = g % 4 == 0 ? 0.5 : 0;
  extended.histories = {shapes, coefficients};
  extended.parameters = 2;
  FittedModel extended_values = extended;
  extended_values.histories = extended.histories.Values();
  EXPECT_NEAR(SignificanceOfGain(of_shapes, extended).value(),
              SignificanceOfGain(as_they_are, extended_values).value(), 1e-9);
  EXPECT_NEAR(Compare(extended, of_shapes)->nats, Compare(extended_values, as_they_are)->nats,
              1e-8);
  std::vector<int> ends(kReadings, 0);  // one reading is fewer than there are shapes
  ends.back() = 1;
  EXPECT_NEAR(LeftOutError(extended, ends).value(), LeftOutError(extended_values, ends).value(),
              1e-8);
}

TEST(Diagnosis, ShapesThatDoNotFitAreRefused) {
  FittedModel few = Line(Curve(0));
  few.draws = Eigen::MatrixXd::Zero(49, kReadings);
  EXPECT_FALSE(TestAdequacy(few).ok());
  few.draws = Eigen::MatrixXd::Zero(60, kReadings - 1);
  EXPECT_FALSE(TestAdequacy(few).ok());
  few.draws = Eigen::MatrixXd::Zero(60, kReadings);
  EXPECT_FALSE(TestAdequacy(few).ok()) << "they do not vary";
  FittedModel model = Line(Curve(0));
  EXPECT_FALSE(Screen(model, {{"short", {Eigen::VectorXd::Ones(3)}, false}}).ok());
  model.covariance.setZero();
  EXPECT_FALSE(TestAdequacy(model).ok());
}

}  // namespace
}  // namespace calib::inference
