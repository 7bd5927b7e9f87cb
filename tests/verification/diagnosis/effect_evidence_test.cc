// Evidences of models against quadrature and closed form.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <iostream>
#include <vector>

#include "inference/diagnosis/model_evidence.h"
#include "inference/diagnosis/visible_strength.h"
#include "inference/numerics/log_weights.h"
#include "tests/support/effects_toy.h"

namespace calib::inference {
namespace {

using Eigen::Index;
using ::testing::HasSubstr;

double SumOfLogs(const std::vector<double>& logs) {
  return LogSumExp(Eigen::Map<const Eigen::VectorXd>(logs.data(), static_cast<Index>(logs.size())));
}

// One parameter, two effects, four packings, runs few enough that the emulator's variance counts.
class EffectEvidence : public ::testing::Test {
 protected:
  CoordinateToy toy_{
      {.parameters = 1, .effects = 2, .coordinates = 4, .seed = 3, .two_sided = {1}}};
  EmulatorData data_ = toy_.Runs(16, 16, 4);
  DiagnosisSet set_ = SetOf(toy_, data_);
  // A specimen with effect 0 at strength 1.5.
  Eigen::VectorXd z_ = [this] {
    const DesignPoints truth{.base = Eigen::MatrixXd{{0.3}},
                             .strength = Eigen::MatrixXd{{1.5, 0}},
                             .shape = Eigen::MatrixXd(1, 0)};
    return Eigen::VectorXd(toy_.Mean(truth).row(0).transpose() +
                           std::sqrt(1.2) * toy_.Normal(4, 1));
  }();

  // ln of p(z | base, strengths), packings and coefficients integrated: the joint normal law of
  // runs and measurement, without the emulator.
  double Joint(const DesignPoints& point) const {
    const Eigen::MatrixXd f = toy_.features().All(data_.points);
    const Eigen::MatrixXd g = toy_.features().All(point);
    const Eigen::VectorXd tau = toy_.FeatureVariances();
    if (inverse_.size() == 0) {
      Eigen::MatrixXd k = f * tau.asDiagonal() * f.transpose();
      for (Index i = 0; i < k.rows(); ++i) {
        for (Index j = 0; j < k.rows(); ++j) {
          if (data_.packing[static_cast<std::size_t>(i)] ==
              data_.packing[static_cast<std::size_t>(j)])
            k(i, j) += 0.3;
        }
        k(i, i) += 0.7;
      }
      inverse_ = k.inverse();
    }
    const Eigen::VectorXd cross = f * tau.asDiagonal() * g.row(0).transpose();
    const Eigen::VectorXd gain = inverse_ * cross;
    const double variance =
        g.row(0).dot(tau.asDiagonal() * g.row(0).transpose()) - cross.dot(gain) + 0.3 + 0.7 + 0.2;
    double result = 0;
    for (Index c = 0; c < z_.size(); ++c) {
      const double r = z_[c] - gain.dot(data_.outputs.col(c));
      result += -0.5 * r * r / variance - 0.5 * std::log(2 * M_PI * variance);
    }
    return result;
  }

  // The evidence of a model by the midpoint rule over base parameter and ln of the strength.
  double Quadrature(int effect, const StrengthPrior& prior) const {
    const int n = 80;
    std::vector<double> logs;
    for (int i = 0; i < n; ++i) {
      DesignPoints point{.base = Eigen::MatrixXd::Constant(1, 1, -1 + 2 * (i + 0.5) / n),
                         .strength = Eigen::MatrixXd::Zero(1, 2),
                         .shape = Eigen::MatrixXd(1, 0)};
      if (effect < 0) {
        logs.push_back(Joint(point) - std::log(n));
        continue;
      }
      const bool two_sided = toy_.features().effects()[static_cast<std::size_t>(effect)].two_sided;
      for (int j = 0; j < n; ++j) {
        const double t = (j + 0.5) / n;
        point.strength(0, effect) = prior.low * std::pow(prior.high / prior.low, t);
        logs.push_back(Joint(point) - 2 * std::log(n) - (two_sided ? std::log(2) : 0));
        if (!two_sided) continue;
        point.strength(0, effect) =
            -prior.negative_low * std::pow(prior.negative_high / prior.negative_low, t);
        logs.push_back(Joint(point) - 2 * std::log(n) - std::log(2));
      }
    }
    return SumOfLogs(logs);
  }

  mutable Eigen::MatrixXd inverse_;
};

// 0.05 nats; 3 % of sampling error at 2000 points, quadrature error far below. Each width sampled
// by itself, and all from the points of the widest.
TEST_F(EffectEvidence, IsThatOfQuadratureUnderEveryWidth) {
  ModelSpace space = ToySpace(toy_);
  space.models = {{}, {.effects = {0}}, {.effects = {1}}};
  std::vector<std::vector<StrengthPrior>> priors;
  for (const auto& [low, high] : {std::pair{0.1, 20.0}, std::pair{0.4, 5.0}, std::pair{0.8, 2.5}}) {
    priors.emplace_back(
        2, StrengthPrior{.low = low, .high = high, .negative_low = low, .negative_high = high / 2});
  }
  space.strength = priors[0];
  const auto together =
      ModelEvidencesUnder({{&set_, z_}}, space, priors, {.sampling = {.seed = 5}});
  ASSERT_TRUE(together.ok()) << together.status();
  double largest = 0;
  for (std::size_t w = 0; w < 3; ++w) {
    space.strength = priors[w];
    const auto alone = ModelEvidences({{&set_, z_}}, space, {.sampling = {.seed = 9}});
    ASSERT_TRUE(alone.ok()) << alone.status();
    for (int effect = -1; effect < 2; ++effect) {
      const double exact = Quadrature(effect, priors[w][0]);
      const auto place = static_cast<std::size_t>(effect + 1);
      for (const ModelEvidence& model : {(*alone)[place], (*together)[w][place]}) {
        largest = std::max(largest, std::abs(model.evidence.log_evidence - exact));
        EXPECT_NEAR(model.evidence.log_evidence, exact, 0.05)
            << "effect " << effect << ", width " << w;
        EXPECT_LT(model.evidence.standard_error, 0.04);
        EXPECT_GT(model.draws.rows(), 190);
        if (effect < 0) continue;
        EXPECT_GE(model.draws.strength.col(effect).cwiseAbs().minCoeff(),
                  priors[w][0].low * (1 - 1e-12));
        EXPECT_LE(model.draws.strength.col(effect).maxCoeff(), priors[w][0].high * (1 + 1e-12));
      }
    }
  }
  std::cout << "largest error of an evidence " << largest << "\n";
  EXPECT_THAT(ModelEvidencesUnder({{&set_, z_}}, space, priors).status().message(),
              HasSubstr("is not within the space's"));
}

// Everything linear and normal, so that the evidence itself has a closed form: base parameter
// normal, its slope known from 400 runs, packings in the measurement's covariance.
TEST(LinearEvidence, IsTheClosedForm) {
  CoordinateToy toy({.parameters = 1, .effects = 1, .coordinates = 5, .seed = 21, .degree = 1});
  const DiagnosisSet set = SetOf(toy, toy.Runs(396, 4, 100));
  ModelSpace space = ToySpace(toy);
  space.models = {{}};
  const double sd = 0.1, mean = 0.2;
  space.log_base_prior = [&](const Eigen::MatrixXd& base) {
    return Eigen::VectorXd(-0.5 * ((base.col(0).array() - mean) / sd).square() -
                           std::log(sd * std::sqrt(2 * M_PI) / 2));
  };
  const Eigen::MatrixXd at = Eigen::MatrixXd::Constant(1, 1, mean);
  const DesignPoints centre{
      .base = at, .strength = Eigen::MatrixXd::Zero(1, 1), .shape = Eigen::MatrixXd(1, 0)};
  const EmulatorPrediction prediction = set.emulator().Predict(centre);
  const Eigen::VectorXd slope = set.emulator().BaseDerivative(at, 0).row(0);
  Eigen::MatrixXd v = sd * sd * slope * slope.transpose();
  v.diagonal() +=
      set.errors().specimen + set.errors().noise + prediction.variance.row(0).transpose();
  for (int i = 0; i < 5; ++i) {
    const Eigen::VectorXd r = Eigen::LLT<Eigen::MatrixXd>(v).matrixL() * toy.Normal(5, 1);
    const Eigen::VectorXd z = prediction.mean.row(0).transpose() + r;
    const double closed =
        -0.5 * r.dot(v.inverse() * r) - 0.5 * std::log((2 * M_PI * v).determinant());
    const auto found = ModelEvidences({{&set, z}}, space, {.sampling = {.seed = 1}});
    ASSERT_TRUE(found.ok());
    EXPECT_NEAR((*found)[0].evidence.log_evidence, closed, 0.05);
    std::cout << "closed form " << closed << ", found " << (*found)[0].evidence.log_evidence
              << "\n";
  }
}

// A discrepancy along coordinates that no parameter moves, against quadrature over tau.
TEST_F(EffectEvidence, NoneOfTheseIsThatOfQuadrature) {
  ModelSpace space = ToySpace(toy_);
  space.models = {{.none_of_these = true}};
  Eigen::VectorXd z = z_;
  z[2] += 6;
  const auto found = ModelEvidences({{&set_, z}}, space, {.sampling = {.seed = 9}});
  ASSERT_TRUE(found.ok());
  const int n = 80;
  std::vector<double> logs;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const DesignPoints point{.base = Eigen::MatrixXd::Constant(1, 1, -1 + 2 * (i + 0.5) / n),
                               .strength = Eigen::MatrixXd::Zero(1, 2),
                               .shape = Eigen::MatrixXd(1, 0)};
      const double tau = space.tau_low * std::pow(space.tau_high / space.tau_low, (j + 0.5) / n);
      logs.push_back(
          set_.LogDensityWithDiscrepancy(z, point, Eigen::VectorXd::Constant(1, tau))[0] -
          2 * std::log(n));
    }
  }
  EXPECT_NEAR((*found)[0].evidence.log_evidence, SumOfLogs(logs), 0.05);
}

// Evidence averaged over realisations of the emulator is the evidence with its variance.
TEST_F(EffectEvidence, RealisationsHaveTheEvidenceAsTheirMean) {
  ModelSpace space = ToySpace(toy_);
  const auto found = ModelEvidences({{&set_, z_}}, space,
                                    {.sampling = {.seed = 9}, .draws = 400, .realisations = 400});
  ASSERT_TRUE(found.ok());
  for (const ModelEvidence& model : *found) {
    if (model.model.none_of_these) continue;
    const Eigen::VectorXd log_ratio = model.realised.array() - model.evidence.log_evidence;
    const double mean = LogSumExp(log_ratio) - std::log(400.0);
    const double error =
        std::sqrt((log_ratio.array().exp() - std::exp(mean)).square().mean() / 400) /
        std::exp(mean);
    EXPECT_LT(std::abs(mean), 4 * error + 0.05);
  }
}

TEST_F(EffectEvidence, SameSeedSameBitsAndMoreModelsMoveNone) {
  ModelSpace space = ToySpace(toy_);
  const auto all = ModelEvidences({{&set_, z_}}, space, {.sampling = {.seed = 4}});
  space.models.resize(2);
  const auto two = ModelEvidences({{&set_, z_}}, space, {.sampling = {.seed = 4}});
  ASSERT_TRUE(all.ok() && two.ok());
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ((*all)[i].evidence.log_evidence, (*two)[i].evidence.log_evidence);
    EXPECT_EQ((*all)[i].draws.base, (*two)[i].draws.base);
    EXPECT_EQ((*all)[i].realised, (*two)[i].realised);
  }
}

// Densities of two specimens, whose emulator is one, and of their mean differ by what points share.
TEST_F(EffectEvidence, SpecimensOfASetShareTheEmulatorsErrors) {
  const Eigen::VectorXd other = z_ + Eigen::Vector4d(0.5, -1, 0.2, 0.8);
  const Eigen::VectorXd own = set_.errors().specimen + set_.errors().noise;
  const auto joint = [&](const DesignPoints& point) {
    const EmulatorPrediction p = set_.emulator().Predict(point);
    double result = 0;
    for (Index c = 0; c < 4; ++c) {
      const double shared = p.variance(0, c);
      const Eigen::Matrix2d v{{own[c] + shared, shared}, {shared, own[c] + shared}};
      const Eigen::Vector2d r(z_[c] - p.mean(0, c), other[c] - p.mean(0, c));
      result += -0.5 * r.dot(v.inverse() * r) - 0.5 * std::log(v.determinant());
    }
    return result;
  };
  const Eigen::VectorXd mean = 0.5 * (z_ + other);
  const DesignPoints points{.base = Eigen::MatrixXd{{0.1}, {-0.6}},
                            .strength = Eigen::MatrixXd{{3, 0}, {0, -1}},
                            .shape = Eigen::MatrixXd(2, 0)};
  const Eigen::VectorXd found = set_.LogDensity(mean, points, 2);
  EXPECT_NEAR(found[0] - found[1], joint(RowsOf(points, {0})) - joint(RowsOf(points, {1})), 1e-9);
}

// A first measurement and the mean of both hold it twice; once is taken out.
TEST_F(EffectEvidence, RepeatOfAMeasuredTestCountsTheFirstOnce) {
  const Eigen::VectorXd mean = z_ + 0.5 * Eigen::Vector4d(0.5, -1, 0.2, 0.8);
  const ModelSpace space = ToySpace(toy_);
  const EvidenceOptions options{.sampling = {.seed = 4}};
  const auto both = ModelEvidences({{.set = &set_, .z = z_},
                                    {.set = &set_, .z = mean, .specimens = 2},
                                    {.set = &set_, .z = z_, .taken_out = true}},
                                   space, options);
  const auto once = ModelEvidences({{.set = &set_, .z = mean, .specimens = 2}}, space, options);
  ASSERT_TRUE(both.ok() && once.ok()) << both.status();
  for (std::size_t i = 0; i < once->size(); ++i) {
    EXPECT_NEAR((*both)[i].evidence.log_evidence, (*once)[i].evidence.log_evidence, 0.05);
    EXPECT_LT(((*both)[i].realised - (*once)[i].realised).cwiseAbs().mean(), 0.2);
  }
}

// Another test, whose emulator knows one effect of two: its part of the evidence is the mean of its
// density over the posterior of the first.
TEST_F(EffectEvidence, AnotherTestMayKnowFewerEffects) {
  CoordinateToy other({.parameters = 1, .effects = 1, .coordinates = 3, .seed = 8});
  const DiagnosisSet second = SetOf(other, other.Runs(16, 16, 4));
  const Eigen::VectorXd z = other
                                .Mean({.base = Eigen::MatrixXd{{0.3}},
                                       .strength = Eigen::MatrixXd{{1.5}},
                                       .shape = Eigen::MatrixXd(1, 0)})
                                .row(0);
  ModelSpace space = ToySpace(toy_);
  const std::vector<MeasuredSet> measured = {
      {.set = &set_, .z = z_}, {.set = &second, .z = z, .columns = PointColumns{.strength = {0}}}};
  EXPECT_THAT(ModelEvidences(measured, space).status().message(),
              HasSubstr("a model has effect 1, which a set's emulator has not"));
  space.models = {{}, {.effects = {0}}};
  const EvidenceOptions options{.sampling = {.seed = 4}, .draws = 2000};
  const auto joint = ModelEvidences(measured, space, options);
  const auto first = ModelEvidences({measured[0]}, space, options);
  ASSERT_TRUE(joint.ok() && first.ok()) << joint.status();
  for (std::size_t i = 0; i < 2; ++i) {
    const DesignPoints draws = ColumnsOf((*first)[i].draws, measured[1].columns);
    const double gain =
        LogSumExp(second.LogDensity(z, draws)) - std::log(static_cast<double>(draws.rows()));
    EXPECT_NEAR((*joint)[i].evidence.log_evidence - (*first)[i].evidence.log_evidence, gain, 0.1);
  }
}

TEST(ModelSpaceTest, ListsModelsAndSharesThePrior) {
  const std::vector<std::pair<int, int>> excluded = {{2, 1}};
  std::vector<EffectModel> models = AllModels(4, excluded);
  EXPECT_EQ(models.size(), 1u + 4 + 5 + 1);
  // Of three that could join the pair one excludes a member; there could be {0, 2, 3} besides.
  const std::vector<EffectModel> triples = TriplesOf(4, excluded, {{.effects = {0, 1}}});
  ASSERT_EQ(triples.size(), 1u);
  EXPECT_EQ(triples[0].effects, (std::vector<int>{0, 1, 3}));
  EXPECT_EQ(CountTriples(4, excluded), 2);
  models.push_back(triples[0]);
  CoordinateToy toy({.effects = 4});
  ModelSpace space = ToySpace(toy);
  space.models = models;
  ASSERT_TRUE(space.Validate().ok());
  const Eigen::VectorXd prior = space.LogPrior().array().exp();
  EXPECT_NEAR(prior.sum(), 1, 1e-12);
  EXPECT_NEAR(prior[0] / prior[1], 4, 1e-12);  // 0.4 for it, 0.4 for four singles
  EXPECT_NEAR(prior[5] * 5 / (prior[1] * 4), 1. / 20, 1e-12);
  EXPECT_NEAR(prior[11] / (prior[5] * 5), 1. / 30, 1e-12);
  space.triples = 2;
  const Eigen::VectorXd of_two = space.LogPrior().array().exp();
  EXPECT_NEAR(of_two[11] / (of_two[5] * 5), 1. / 60, 1e-12) << "one of two that there could be";
  space.strength[1].high = 0.1;
  EXPECT_THAT(space.Validate().message(), HasSubstr("strengths of effect 1 range from 0.4 to 0.1"));
}

// Of any number of effects, none of which exclude each other.
TEST(ModelSpaceTest, OneEffectMoreActsWithOddsOfOneToTen) {
  for (const int effects : {4, 9}) {
    CoordinateToy toy({.effects = effects});
    ModelSpace space = ToySpace(toy);
    space.models = AllModels(effects, {});
    for (const EffectModel& triple : TriplesOf(effects, {}, space.models)) {
      if (triple.effects.size() == 3) space.models.push_back(triple);
    }
    const Eigen::VectorXd prior = space.LogPrior().array().exp();
    const auto with = [&](const std::vector<int>& acting, std::size_t more) {
      double sum = 0;
      for (std::size_t i = 0; i < space.models.size(); ++i) {
        const std::vector<int>& own = space.models[i].effects;
        if (own.size() == acting.size() + more &&
            std::includes(own.begin(), own.end(), acting.begin(), acting.end()))
          sum += prior[static_cast<Index>(i)];
      }
      return sum;
    };
    EXPECT_NEAR(with({1}, 1), 0.1 * with({1}, 0), 1e-12);
    EXPECT_NEAR(with({1, 3}, 1), 0.1 * with({1, 3}, 0), 1e-12);
  }
}

TEST_F(EffectEvidence, StrengthOfLambdaIsSeenAsStated) {
  const ModelSpace space = ToySpace(toy_);
  const Eigen::RowVectorXd base = Eigen::RowVectorXd::Constant(1, 0.1);
  for (const double lambda : {4.0, 21.0}) {
    const double strength = StrengthOfLambda(
        {&set_}, space, base, {.effect = 0, .sign = 1, .lambda = lambda, .largest = 200});
    const DesignPoints point{
        .base = base, .strength = Eigen::MatrixXd{{strength, 0}}, .shape = Eigen::MatrixXd(1, 0)};
    EXPECT_NEAR(SquaredDistanceFromBase({&set_}, space, point), lambda, 0.05 * lambda);
  }
}

TEST_F(EffectEvidence, RefusesWhatDoesNotFit) {
  const ModelSpace space = ToySpace(toy_);
  EXPECT_THAT(ModelEvidences({{&set_, Eigen::VectorXd::Zero(3)}}, space).status().message(),
              HasSubstr("has 3 coordinates, its set 4"));
  EXPECT_THAT(ModelEvidences({}, space).status().message(), HasSubstr("nothing is measured"));
}

}  // namespace
}  // namespace calib::inference
