// Cubic RBF and merit against reference/inference/rbf_cubic.json, tolerances of its README, sec. 4:
// values 1e-9 after scaling by max |f|, gradients 1e-8, coefficients 1e-8 relative.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <string>

#include "inference/surrogate/cubic_rbf.h"
#include "inference/surrogate/merit.h"
#include "tests/data/inference/reference_files.h"

namespace calib::inference {
namespace {

class RbfReference : public ::testing::TestWithParam<int> {
 protected:
  RbfReference()
      : reference_(
            ReadReference("rbf_cubic.json").at("cases").at(static_cast<std::size_t>(GetParam()))) {}

  CubicRbf Build() const {
    const Eigen::MatrixXd points = ToMatrix(reference_.at("X"));
    const Eigen::VectorXd values = ToVector(reference_.at("f"));
    CubicRbf rbf(static_cast<int>(points.cols()));
    for (Eigen::Index i = 0; i < points.rows(); ++i)
      EXPECT_TRUE(rbf.Add(points.row(i), values[i]).ok());
    return rbf;
  }
  double Scale() const { return ToVector(reference_.at("f")).cwiseAbs().maxCoeff(); }

  nlohmann::json reference_;
};

TEST_P(RbfReference, ValuesAndGradients) {
  const CubicRbf rbf = Build();
  const Eigen::MatrixXd points = ToMatrix(reference_.at("test_points"));
  const Eigen::VectorXd values = ToVector(reference_.at("values"));
  const Eigen::MatrixXd gradients = ToMatrix(reference_.at("gradients"));
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    EXPECT_NEAR(rbf.Value(points.row(i)), values[i], 1e-9 * Scale());
    EXPECT_LT((rbf.Gradient(points.row(i)) - gradients.row(i).transpose()).cwiseAbs().maxCoeff(),
              1e-8);
  }
}

TEST_P(RbfReference, Coefficients) {
  const CubicRbf rbf = Build();
  const Eigen::VectorXd coefficients = ToVector(reference_.at("rbf_coefficients"));
  const Eigen::VectorXd tail = ToVector(reference_.at("tail_coefficients_1_x"));
  for (Eigen::Index i = 0; i < coefficients.size(); ++i) {
    EXPECT_NEAR(rbf.coefficients()[i] / coefficients[i], 1, 1e-8);
  }
  for (Eigen::Index i = 0; i < tail.size(); ++i) EXPECT_NEAR(rbf.tail()[i] / tail[i], 1, 1e-8);
}

TEST_P(RbfReference, BestCandidateOfEveryWeight) {
  const CubicRbf rbf = Build();
  const auto& merit = reference_.at("merit");
  const Eigen::MatrixXd candidates = ToMatrix(merit.at("candidates"));
  Eigen::VectorXd values(candidates.rows());
  Eigen::VectorXd distances(candidates.rows());
  for (Eigen::Index k = 0; k < candidates.rows(); ++k) {
    values[k] = rbf.Value(candidates.row(k));
    double nearest = 1e300;
    for (int i = 0; i < rbf.size(); ++i)
      nearest = std::min(nearest, (candidates.row(k).transpose() - rbf.point(i)).norm());
    distances[k] = nearest;
  }
  EXPECT_LT((distances - ToVector(merit.at("min_distance"))).cwiseAbs().maxCoeff(), 1e-12);
  for (const auto& [weight, expected] : merit.at("by_weight").items()) {
    const MeritOptions options{.weight = std::stod(weight), .min_distance = 1e-3};
    const Eigen::Index best = BestCandidate(values, distances, options);
    EXPECT_EQ(best, expected.at("best").get<int>()) << "weight " << weight;
    EXPECT_NEAR(Merits(values, distances, options.weight)[best],
                expected.at("best_merit").get<double>(), 1e-9);
  }
}

INSTANTIATE_TEST_SUITE_P(Cases, RbfReference, ::testing::Values(0, 1));

}  // namespace
}  // namespace calib::inference
