#include "inference/diagnosis/specimen_likelihood.h"

#include <cmath>

#include "inference/numerics/decompositions.h"
#include "inference/numerics/special_functions.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// Student's law of q coordinates, or the normal one, given |L^-1 (z - m)|^2 and ln |V|.
class EllipticLaw {
 public:
  EllipticLaw(double freedom, Index q)
      : freedom_(freedom), q_(static_cast<double>(q)), normal_(!std::isfinite(freedom)) {
    constant_ = normal_ ? -0.5 * q_ * std::log(2 * M_PI)
                        : LogGamma((freedom + q_) / 2) - LogGamma(freedom / 2) -
                              0.5 * q_ * std::log(freedom * M_PI);
  }
  double LogDensity(double square, double log_determinant) const {
    const double kernel =
        normal_ ? 0.5 * square : 0.5 * (freedom_ + q_) * std::log1p(square / freedom_);
    return constant_ - 0.5 * log_determinant - kernel;
  }

 private:
  double freedom_, q_, constant_;
  bool normal_;
};

}  // namespace

Eigen::MatrixXd DiagonalVariance(const EmulatorPrediction& prediction,
                                 const SpecimenErrors& errors) {
  return ((prediction.variance + prediction.added_run_variance * errors.run.transpose()).rowwise() +
          errors.OfMeasurement().transpose());
}

Eigen::VectorXd SpecimenLogDensity(const Eigen::VectorXd& z, const EmulatorPrediction& prediction,
                                   const SpecimenErrors& errors) {
  const Index m = prediction.mean.rows(), q = z.size(), j = errors.staging.cols();
  const Eigen::MatrixXd variance = DiagonalVariance(prediction, errors);
  const EllipticLaw law(errors.freedom, q);
  Eigen::VectorXd result(m);
  for (Index i = 0; i < m; ++i) {
    const Eigen::ArrayXd sd = variance.row(i).transpose().array().sqrt();
    const Eigen::VectorXd r = (z - prediction.mean.row(i).transpose()).array() / sd;
    double square = r.squaredNorm(), log_determinant = 2 * sd.log().sum();
    if (j > 0) {
      // (D + U U^T)^-1 and its determinant by J x J algebra      [Woodbury 1950; Sylvester 1851]
      const Eigen::MatrixXd w = sd.inverse().matrix().asDiagonal() * errors.staging;
      const Eigen::LLT<Eigen::MatrixXd> inner(Eigen::MatrixXd::Identity(j, j) + w.transpose() * w);
      square -= LowerSolved(inner, w.transpose() * r).squaredNorm();
      log_determinant += 2 * inner.matrixLLT().diagonal().array().log().sum();
    }
    result[i] = law.LogDensity(square, log_determinant);
  }
  return result;
}

Eigen::VectorXd SpecimenLogDensity(const Eigen::VectorXd& z, const EmulatorPrediction& prediction,
                                   const SpecimenErrors& errors,
                                   const OrthogonalDiscrepancy& discrepancy) {
  const Index m = prediction.mean.rows(), q = z.size();
  const auto d = static_cast<Index>(discrepancy.sensitivities.size());
  const Eigen::MatrixXd variance = DiagonalVariance(prediction, errors);
  const EllipticLaw law(errors.freedom, q);
  const Eigen::MatrixXd staging = errors.staging * errors.staging.transpose();
  Eigen::VectorXd result(m);
  for (Index i = 0; i < m; ++i) {
    Eigen::MatrixXd directions(q, d);
    for (Index p = 0; p < d; ++p)
      directions.col(p) = discrepancy.sensitivities[static_cast<std::size_t>(p)].row(i);
    const Eigen::MatrixXd along =
        OrthonormalColumns(Eigen::HouseholderQR<Eigen::MatrixXd>(directions));
    const double each = discrepancy.tau[i] * discrepancy.tau[i] / static_cast<double>(q - d);
    Eigen::MatrixXd v = staging - each * along * along.transpose();
    v.diagonal() += variance.row(i).transpose() + Eigen::VectorXd::Constant(q, each);
    const Eigen::LLT<Eigen::MatrixXd> factor(v);
    const double square = LowerSolved(factor, z - prediction.mean.row(i).transpose()).squaredNorm();
    result[i] = law.LogDensity(square, 2 * factor.matrixLLT().diagonal().array().log().sum());
  }
  return result;
}

}  // namespace calib::inference
