#include "inference/prior/joint_prior.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "inference/filter/iterative_filter.h"

namespace calib::inference {
namespace {

using ::testing::HasSubstr;

std::vector<Prior> Unit(int d) {
  return std::vector<Prior>(static_cast<std::size_t>(d),
                            Prior{.kind = PriorKind::kUniform, .min = 0, .max = 1});
}

TEST(JointPrior, IndependentIsTheProductOfItsMarginals) {
  const std::vector<Prior> marginals = {{.kind = PriorKind::kLogUniform, .min = 1, .max = 100},
                                        {.kind = PriorKind::kNormal, .mean = 2, .sd = 3}};
  const JointPrior prior = marginals;
  const Eigen::Vector2d x(7, -1);
  EXPECT_EQ(prior.LogDensity(x), marginals[0].LogDensity(7) + marginals[1].LogDensity(-1));
  EXPECT_EQ(prior.LogDensity(Eigen::Vector2d(0.5, 0)), -std::numeric_limits<double>::infinity());
}

TEST(JointPrior, NormalScoreAndItsInverseAgreeInTheTails) {
  for (const Prior& prior :
       {Prior{.kind = PriorKind::kUniform, .min = -1, .max = 4},
        Prior{.kind = PriorKind::kLogUniform, .min = 1, .max = 1e3},
        Prior{.kind = PriorKind::kNormal, .mean = 1, .sd = 2},
        Prior{.kind = PriorKind::kNormal, .min = 0, .mean = -5, .sd = 1},
        Prior{.kind = PriorKind::kLogNormal, .max = 9, .mean = 1, .sd = 0.5}}) {
    for (const double z : {-6.0, -1.3, 0.0, 0.4, 5.0}) {
      EXPECT_NEAR(prior.NormalScore(prior.FromNormalScore(z)), z, 1e-6 * (1 + std::abs(z)));
    }
  }
}

TEST(JointPrior, RefusesCorrelationsThatContradictEachOther) {
  Eigen::Matrix3d correlation;
  correlation << 1, 0.9, 0.9, 0.9, 1, -0.9, 0.9, -0.9, 1;
  const auto prior = JointPrior::Create(Unit(3), correlation, {});
  EXPECT_EQ(prior.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(prior.status().message(), HasSubstr("not positive definite"));
}

TEST(JointPrior, RefusesAnEmptyPrior) {
  const auto prior =
      JointPrior::Create(Unit(2), {}, {{.coefficients = Eigen::Vector2d(1, 1), .limit = -0.1}});
  EXPECT_THAT(prior.status().message(), HasSubstr("leave a share of 0 of the prior"));
}

TEST(JointPrior, ADesignPassesOverWhatViolatesAConstraint) {
  const JointPrior prior =
      JointPrior::Create(Unit(2), {}, {{.coefficients = Eigen::Vector2d(1, 1), .limit = 0.5}})
          .value();
  const FilterOptions options{.design = Design::kSobol, .seed = 1};
  const Eigen::MatrixXd few = DrawSamples({}, prior, options, 0, 64).value();
  const Eigen::MatrixXd many = DrawSamples({}, prior, options, 0, 200).value();
  EXPECT_EQ(few, many.topRows(64)) << "a whole block does not depend on the number of rows";
  EXPECT_LE(many.rowwise().sum().maxCoeff(), 0.5);
}

// Sample i of a campaign runs on packing i mod R: no packing may have parameters of its own.
TEST(JointPrior, RowsOfADesignGoByNoParameter) {
  constexpr int kRows = 240;
  for (const Design design : {Design::kHalton, Design::kSobol}) {
    const FilterOptions options{.design = design, .seed = 1};
    const Eigen::MatrixXd rows = DrawSamples({}, JointPrior(Unit(3)), options, 0, kRows).value();
    for (const int packings : {2, 3, 4, 5, 8, 10}) {
      for (int j = 0; j < 3; ++j) {
        Eigen::VectorXd mean = Eigen::VectorXd::Zero(packings);
        for (int i = 0; i < kRows; ++i) mean[i % packings] += rows(i, j) * packings / kRows;
        // Of the variance 1/12 the packings' means have 1/kRows each by chance; in the order of the
        // sequence up to all of it.
        const double share = 12 * (mean.array() - mean.mean()).square().mean();
        EXPECT_LT(share, 6.0 * packings / kRows) << packings << " packings, parameter " << j;
      }
    }
  }
}

TEST(JointPrior, FurtherParametersAreIndependent) {
  Eigen::Matrix2d correlation;
  correlation << 1, 0.5, 0.5, 1;
  const JointPrior two = JointPrior::Create(Unit(2), correlation,
                                            {{.coefficients = Eigen::Vector2d(1, -1), .limit = 0}})
                             .value();
  const Prior normal{.kind = PriorKind::kNormal, .mean = 0, .sd = 2};
  const JointPrior three = two.With(std::vector<Prior>{normal});
  const Eigen::Vector3d x(0.2, 0.7, 1);
  EXPECT_DOUBLE_EQ(three.LogDensity(x), two.LogDensity(x.head(2)) + normal.LogDensity(1));
  EXPECT_FALSE(three.InSupport(Eigen::Vector3d(0.7, 0.2, 1)));
}

}  // namespace
}  // namespace calib::inference
