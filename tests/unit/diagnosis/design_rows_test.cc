// Rows of a design as points and as values by name.
#include "server/diagnosis/design_rows.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/diagnosis/mixed_rows.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;
using ::testing::ElementsAre;

// A one-sided effect that grows downward with a form, and one of both signs.
DesignRows RowsOfTwo() {
  Race race{.base = {"modulus", "friction"}};
  race.effects = {
      {.name = "a",
       .strength = "a.s",
       .null = 1.5,
       .near = -0.1,
       .far = -0.4,
       .most = 1,
       .design = {.shapes = 1},
       .shapes = {{.name = "a.form",
                   .prior = {.kind = inference::PriorKind::kLogUniform, .min = 0.1, .max = 10},
                   .absent = 1}}},
      {.name = "b",
       .strength = "b.s",
       .near = 2,
       .far = 4,
       .most = 10,
       .most_other = 6,
       .design = {.two_sided = true}}};
  race.numerics = {{.name = "numerics.rate", .tried = 2}};
  const std::vector<inference::Prior> priors = {
      {.kind = inference::PriorKind::kLogUniform, .min = 1e8, .max = 1e10},
      {.kind = inference::PriorKind::kUniform, .min = 0, .max = 1}};
  return {AxesOver(priors, Eigen::MatrixXd{{1e8, 0.2}, {1e9, 0.6}}), race, Eigen::Vector2d(0.2, 4)};
}

TEST(DesignRows, AreValuesByNameAndBack) {
  const DesignRows rows = RowsOfTwo();
  EXPECT_THAT(rows.names(),
              ElementsAre("modulus", "friction", "a.s", "a.form", "b.s", "numerics.rate"));
  const inference::DesignPoints points{.base = Eigen::MatrixXd{{0, 0}, {-1, 1}},
                                       .strength = Eigen::MatrixXd{{2, -0.5}, {0, 1}},
                                       .shape = Eigen::MatrixXd{{0.5}, {0.7}}};
  const std::vector<double> first = rows.Values(points, 0), second = rows.Values(points, 1);
  EXPECT_NEAR(first[0], std::sqrt(1e17), 1e3);
  EXPECT_NEAR(first[1], 0.4, 1e-12);
  EXPECT_NEAR(first[2], 1.5 - 0.4, 1e-12) << "its positive side is below the null";
  EXPECT_NEAR(first[4], -2, 1e-12);
  EXPECT_EQ(first[5], 1);
  EXPECT_EQ(second[2], 1.5) << "to the bit";
  EXPECT_EQ(second[3], 1) << "of an effect that is off";
  const inference::DesignPoints back = rows.Points({first, second});
  EXPECT_LT((back.base - points.base).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT((back.strength - points.strength).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_EQ(back.strength(1, 0), 0);
  EXPECT_NEAR(back.shape(0, 0), 0.5, 1e-9);
  EXPECT_EQ(back.shape(1, 0), 0);
}

TEST(DesignRows, StayWithinWhatAnEffectCanHave) {
  const DesignRows rows = RowsOfTwo();
  EXPECT_NEAR(rows.Most()[0], 5, 1e-12);
  EXPECT_NEAR(rows.MostOther()[1], 1.5, 1e-12);
  const inference::DesignPoints points{.base = Eigen::MatrixXd{{3, -3}},
                                       .strength = Eigen::MatrixXd{{9, -9}},
                                       .shape = Eigen::MatrixXd{{2}}};
  const std::vector<double> values = rows.Values(points, 0);
  EXPECT_NEAR(values[0], 1e10, 1);
  EXPECT_EQ(values[1], 0);
  EXPECT_EQ(values[2], 0.5);
  EXPECT_EQ(values[3], 10);
  EXPECT_EQ(values[4], -6);
}

TEST(DesignRows, NumericsAreToldFromRunsOfTheModel) {
  const DesignRows rows = RowsOfTwo();
  const std::vector<double> values = {1e9, 0.5, 1.5, 1, 0, 1};
  EXPECT_EQ(rows.ChangedNumerics(values), -1);
  EXPECT_EQ(rows.ChangedNumerics(rows.WithNumerics(values, 0)), 0);
  EXPECT_EQ(rows.WithNumerics(values, 0)[5], 2);
}

TEST(BaseAxes, NarrowToPartOfTheBox) {
  const DesignRows rows = RowsOfTwo();
  const BaseAxes narrow = rows.axes().Narrowed(Eigen::Vector2d(0, -1), Eigen::Vector2d(1, 1));
  EXPECT_NEAR(narrow.Values(Eigen::MatrixXd{{-1, -1}})(0, 0), std::sqrt(1e17), 1e3);
  EXPECT_NEAR(narrow.Values(Eigen::MatrixXd{{1, -1}})(0, 0), 1e9, 1);
  EXPECT_NEAR(narrow.Values(Eigen::MatrixXd{{1, -1}})(0, 1), 0.2, 1e-12);
}

MixedDesign DesignOfSix(Index n) {
  MixedDesign design{.base = Eigen::MatrixXd::Zero(n, 2),
                     .effects = {6, inference::DesignEffect()},
                     .low = Eigen::VectorXd::Constant(6, 0.4),
                     .high = Eigen::VectorXd::Constant(6, 17),
                     .other_low = Eigen::VectorXd::Constant(6, 0.4),
                     .other_high = Eigen::VectorXd::Constant(6, 5),
                     .apart = {{0, 1}, {0, 2}},
                     .seed = 3};
  design.effects[3].two_sided = true;
  design.effects[5].shapes = 2;
  return design;
}

TEST(MixedRows, UseEveryEffectAsOftenAndNeverThoseThatExclude) {
  const inference::DesignPoints points = MixedRows(DesignOfSix(32));
  EXPECT_EQ(points.shape.cols(), 2);
  for (Index i = 0; i < 32; ++i) {
    const Index on = (points.strength.row(i).array() != 0).count();
    EXPECT_GE(on, 2);
    EXPECT_LE(on, 4);
    if (points.strength(i, 0) != 0) {
      EXPECT_EQ(points.strength(i, 1), 0);
      EXPECT_EQ(points.strength(i, 2), 0);
    }
  }
  for (Index k = 0; k < 6; ++k) {
    const auto s = points.strength.col(k).array();
    EXPECT_GE((s != 0).count(), 13) << k;
    EXPECT_LE((s != 0).count(), 19) << k;
    EXPECT_EQ(s.maxCoeff(), 17) << "its end is among them, to the bit";
    EXPECT_GE((s.abs() > 0 && s.abs() < 2.6).count(), 5) << "half of them below the middle";
    if (k != 3) {
      EXPECT_GE(s.minCoeff(), 0);
    }
  }
  const auto both = points.strength.col(3).array();
  EXPECT_LE(std::abs((both > 0).count() - (both < 0).count()), 1);
  EXPECT_EQ(both.minCoeff(), -5);
  EXPECT_LT(std::abs(points.shape.col(0).sum()), 4);
}

TEST(MixedRows, AreTheSameForTheSameSeed) {
  MixedDesign design = DesignOfSix(24);
  const inference::DesignPoints a = MixedRows(design), b = MixedRows(design);
  EXPECT_EQ(a.strength, b.strength);
  EXPECT_EQ(a.shape, b.shape);
  design.seed = 4;
  EXPECT_NE(MixedRows(design).strength, a.strength);
}

TEST(MixedRows, OneEffectIsOnInEveryRow) {
  MixedDesign design{.base = Eigen::MatrixXd::Zero(24, 1),
                     .effects = {inference::DesignEffect()},
                     .low = Eigen::VectorXd::Constant(1, 0.4),
                     .high = Eigen::VectorXd::Constant(1, 17),
                     .other_low = Eigen::VectorXd::Ones(1),
                     .other_high = Eigen::VectorXd::Ones(1)};
  EXPECT_GE(MixedRows(design).strength.minCoeff(), 0.4);
}

}  // namespace
}  // namespace calib::diagnosis
