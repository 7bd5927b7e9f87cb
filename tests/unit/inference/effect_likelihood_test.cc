// The likelihood of one specimen against dense algebra, and adaptive importance sampling against
// integrals that are known.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "inference/diagnosis/specimen_likelihood.h"
#include "inference/evidence/adaptive_importance.h"

namespace calib::inference {
namespace {

using Eigen::Index;

EmulatorPrediction SomePrediction(Index m, Index q) {
  EmulatorPrediction p{.mean = Eigen::MatrixXd(m, q),
                       .variance = Eigen::MatrixXd(m, q),
                       .added_run_variance = Eigen::VectorXd(m)};
  for (Index i = 0; i < m; ++i) {
    p.added_run_variance[i] = 0.1 * static_cast<double>(i);
    for (Index c = 0; c < q; ++c) {
      p.mean(i, c) = std::sin(1.0 + 3 * static_cast<double>(i) + static_cast<double>(c));
      p.variance(i, c) = 0.1 + 0.05 * static_cast<double>((i + c) % 4);
    }
  }
  return p;
}

SpecimenErrors SomeErrors(Index q, Index j) {
  SpecimenErrors e{.specimen = Eigen::VectorXd::LinSpaced(q, 0.2, 0.9),
                   .run = Eigen::VectorXd::LinSpaced(q, 0.1, 0.8),
                   .noise = Eigen::VectorXd::LinSpaced(q, 0.8, 0.1),
                   .staging = Eigen::MatrixXd(q, j),
                   .share = 0.8,
                   .freedom = 12};
  for (Index c = 0; c < q; ++c) {
    for (Index k = 0; k < j; ++k) e.staging(c, k) = std::cos(static_cast<double>(2 * c + 5 * k));
  }
  return e;
}

double DenseStudent(const Eigen::VectorXd& r, const Eigen::MatrixXd& v, double nu) {
  const auto q = static_cast<double>(r.size());
  const double square = r.dot(v.inverse() * r);
  return std::lgamma((nu + q) / 2) - std::lgamma(nu / 2) - 0.5 * q * std::log(nu * M_PI) -
         0.5 * std::log(v.determinant()) - 0.5 * (nu + q) * std::log1p(square / nu);
}

TEST(SpecimenLikelihood, IsStudentsLawOfTheWholeCovariance) {
  const Index q = 6, m = 5;
  const EmulatorPrediction p = SomePrediction(m, q);
  const Eigen::VectorXd z = Eigen::VectorXd::LinSpaced(q, -2, 2);
  for (const Index j : {0, 2}) {
    const SpecimenErrors e = SomeErrors(q, j);
    const Eigen::VectorXd found = SpecimenLogDensity(z, p, e);
    for (Index i = 0; i < m; ++i) {
      Eigen::MatrixXd v = e.staging * e.staging.transpose();
      v.diagonal() += 0.8 * e.specimen + e.noise + p.added_run_variance[i] * e.run +
                      p.variance.row(i).transpose();
      EXPECT_NEAR(found[i], DenseStudent(z - p.mean.row(i).transpose(), v, 12), 1e-10);
    }
  }
}

TEST(SpecimenLikelihood, ApproachesTheNormalLawWithMuchFreedom) {
  const EmulatorPrediction p = SomePrediction(3, 4);
  const Eigen::VectorXd z = Eigen::VectorXd::LinSpaced(4, -1, 1);
  SpecimenErrors e = SomeErrors(4, 1);
  e.freedom = 1e7;
  const Eigen::VectorXd student = SpecimenLogDensity(z, p, e);
  e.freedom = std::numeric_limits<double>::infinity();
  EXPECT_LT((student - SpecimenLogDensity(z, p, e)).cwiseAbs().maxCoeff(), 1e-4);
}

TEST(SpecimenLikelihood, DiscrepancyIsWhatNoParameterCanMimic) {
  const Index q = 6, m = 4;
  const EmulatorPrediction p = SomePrediction(m, q);
  const SpecimenErrors e = SomeErrors(q, 1);
  const Eigen::VectorXd z = Eigen::VectorXd::LinSpaced(q, -2, 2);
  OrthogonalDiscrepancy d{.sensitivities = {}, .tau = Eigen::VectorXd::LinSpaced(m, 1, 9)};
  for (const double phase : {0.3, 1.7}) {
    Eigen::MatrixXd s(m, q);
    for (Index i = 0; i < m; ++i) {
      for (Index c = 0; c < q; ++c) s(i, c) = std::sin(phase * static_cast<double>(1 + i + c * c));
    }
    d.sensitivities.push_back(s);
  }
  const Eigen::VectorXd found = SpecimenLogDensity(z, p, e, d);
  for (Index i = 0; i < m; ++i) {
    Eigen::MatrixXd s(q, 2);
    s << d.sensitivities[0].row(i).transpose(), d.sensitivities[1].row(i).transpose();
    const Eigen::MatrixXd projection =
        Eigen::MatrixXd::Identity(q, q) - s * (s.transpose() * s).inverse() * s.transpose();
    Eigen::MatrixXd v = e.staging * e.staging.transpose() + d.tau[i] * d.tau[i] / 4 * projection;
    v.diagonal() += 0.8 * e.specimen + e.noise + p.added_run_variance[i] * e.run +
                    p.variance.row(i).transpose();
    EXPECT_NEAR(found[i], DenseStudent(z - p.mean.row(i).transpose(), v, 12), 1e-9);
  }
}

// A normal law well inside the cube: its integral is one.
CubeLikelihood NormalInCube(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) {
  const Eigen::MatrixXd inverse = covariance.inverse();
  const double log_norm = -0.5 * static_cast<double>(mean.size()) * std::log(2 * M_PI) -
                          0.5 * std::log(covariance.determinant());
  return [=](const Eigen::MatrixXd& u) {
    Eigen::VectorXd result(u.rows());
    for (Index i = 0; i < u.rows(); ++i) {
      const Eigen::VectorXd r = u.row(i).transpose() - mean;
      result[i] = log_norm - 0.5 * r.dot(inverse * r);
    }
    return result;
  };
}

TEST(AdaptiveImportance, IntegratesNormalLawsOfTwoToNineParameters) {
  for (const Index d : {1, 2, 5, 9}) {
    // Correlations of 0.7 and sd of 0.02: in nine dimensions 1e-12 of the cube.
    const Eigen::MatrixXd covariance =
        0.02 * 0.02 * (0.3 * Eigen::MatrixXd::Identity(d, d) + 0.7 * Eigen::MatrixXd::Ones(d, d));
    const CubeSample sample = SampleCube(
        NormalInCube(Eigen::VectorXd::LinSpaced(d, 0.3, 0.6), covariance), d, {.seed = 4});
    EXPECT_LT(std::abs(sample.evidence.log_evidence), 4 * sample.evidence.standard_error) << d;
    EXPECT_LT(sample.evidence.standard_error, d < 6 ? 0.05 : 0.12) << d;
    EXPECT_LT(sample.tail, 0.7) << d;
  }
}

TEST(AdaptiveImportance, StandardErrorIsHonest) {
  const Eigen::MatrixXd covariance = Eigen::MatrixXd{{4e-3, 2e-3}, {2e-3, 3e-3}};
  const CubeLikelihood likelihood = NormalInCube(Eigen::Vector2d(0.4, 0.6), covariance);
  double squares = 0;
  const int n = 60;
  for (int i = 0; i < n; ++i) {
    const CubeSample sample =
        SampleCube(likelihood, 2, {.seed = 7, .number = static_cast<std::uint64_t>(i)});
    const double z = sample.evidence.log_evidence / sample.evidence.standard_error;
    squares += z * z / n;
  }
  // sqrt(2 / 60) = 0.18; the net and the mixture of all proposals may only be better.
  EXPECT_LT(squares, 1.7);
  EXPECT_GT(squares, 0.2);
}

TEST(AdaptiveImportance, FlatAndEmptyLikelihoods) {
  const CubeSample flat = SampleCube(
      [](const Eigen::MatrixXd& u) { return Eigen::VectorXd::Constant(u.rows(), -3); }, 3, {});
  EXPECT_NEAR(flat.evidence.log_evidence, -3, 4 * flat.evidence.standard_error);
  EXPECT_LT(flat.evidence.standard_error, 0.05);
  const double infinity = std::numeric_limits<double>::infinity();
  const CubeSample empty = SampleCube(
      [&](const Eigen::MatrixXd& u) { return Eigen::VectorXd::Constant(u.rows(), -infinity); }, 3,
      {});
  EXPECT_EQ(empty.evidence.log_evidence, -infinity);
  EXPECT_EQ(empty.evidence.standard_error, infinity);
}

TEST(AdaptiveImportance, FindsBothOfTwoModes) {
  const Eigen::MatrixXd covariance = 1e-3 * Eigen::MatrixXd::Identity(2, 2);
  const CubeLikelihood a = NormalInCube(Eigen::Vector2d(0.2, 0.3), covariance);
  const CubeLikelihood b = NormalInCube(Eigen::Vector2d(0.8, 0.7), covariance);
  const CubeSample sample = SampleCube(
      [&](const Eigen::MatrixXd& u) {
        return Eigen::VectorXd((0.3 * a(u).array().exp() + 0.7 * b(u).array().exp()).log());
      },
      2, {.seed = 2});
  EXPECT_NEAR(sample.evidence.log_evidence, 0, 4 * sample.evidence.standard_error);
  double left = 0;
  for (Index i = 0; i < sample.points.rows(); ++i)
    left += sample.points(i, 0) < 0.5 ? std::exp(sample.log_weights[i]) : 0;
  EXPECT_NEAR(left, 0.3, 0.05);
}

}  // namespace
}  // namespace calib::inference
