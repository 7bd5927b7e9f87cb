#include "inference/numerics/matern_kernel.h"

#include <cmath>
#include <limits>

#include "inference/numerics/decompositions.h"

namespace calib::inference {
namespace {

using Eigen::Index;

struct LogPrior {
  double mean, sd;
};

// Prior of the logarithm of hyper-parameter j among d lengths, signal, scatter, group: as the
// header states it.
LogPrior HyperPrior(Index j, Index d) {
  if (j < d) return {std::log(3.0), 1};
  if (j == d) return {0, 2};
  return {std::log(1e-3), 3};
}

}  // namespace

Eigen::MatrixXd KernelMatrix(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b,
                             const KernelParameters& parameters) {
  const Eigen::MatrixXd scaled_a = a.array().rowwise() / parameters.lengths.array();
  const Eigen::MatrixXd scaled_b = b.array().rowwise() / parameters.lengths.array();
  Eigen::MatrixXd kernel = -2 * scaled_a * scaled_b.transpose();
  kernel.colwise() += scaled_a.rowwise().squaredNorm();
  kernel.rowwise() += scaled_b.rowwise().squaredNorm().transpose();
  // z = sqrt5 r; the difference of squares may fall below zero by rounding.
  kernel = (5 * kernel.array().max(0)).sqrt();
  kernel =
      parameters.signal * (1 + kernel.array() * (1 + kernel.array() / 3)) * (-kernel.array()).exp();
  kernel.array() += kTrendVariance;
  kernel.noalias() += kTrendVariance * a * b.transpose();
  return kernel;
}

KernelObjective::KernelObjective(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& outputs,
                                 const std::vector<int>& groups)
    : outputs_(outputs), trend_(kTrendVariance * inputs * inputs.transpose()) {
  const Index n = inputs.rows();
  trend_.array() += kTrendVariance;
  squared_.resize(n * (n - 1) / 2, inputs.cols());
  Index pair = 0;
  for (Index j = 0; j < n; ++j) {
    for (Index i = j + 1; i < n; ++i)
      squared_.row(pair++) = (inputs.row(i) - inputs.row(j)).array().square();
  }
  if (groups.empty()) return;
  together_.resize(pair);
  pair = 0;
  for (std::size_t j = 0; j < groups.size(); ++j) {
    for (std::size_t i = j + 1; i < groups.size(); ++i)
      together_[pair++] = groups[i] == groups[j] ? 1 : 0;
  }
}

double KernelObjective::operator()(const Eigen::VectorXd& x, Eigen::VectorXd& gradient) const {
  const Index n = outputs_.size();
  const Index d = squared_.cols();
  const Eigen::VectorXd weights = (-2 * x.head(d)).array().exp();  // 1 / l^2
  const double signal = std::exp(x[d]);
  const double scatter = std::exp(x[d + 1]);
  const bool grouped = together_.size() > 0;
  const double group = grouped ? std::exp(x[d + 2]) : 0;

  const Eigen::ArrayXd z = (5 * (squared_ * weights).array()).sqrt();
  const Eigen::ArrayXd decay = (-z).exp();
  const Eigen::ArrayXd matern = (1 + z * (1 + z / 3)) * decay;
  Eigen::MatrixXd covariance = trend_;
  Index pair = 0;
  for (Index j = 0; j < n; ++j) {
    const Index below = n - 1 - j;
    covariance.col(j).tail(below).array() += signal * matern.segment(pair, below);
    covariance(j, j) += signal + scatter;
    if (grouped) {
      covariance.col(j).tail(below).array() += group * together_.segment(pair, below);
      covariance(j, j) += group;
    }
    pair += below;
  }
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance);  // reads the lower triangle only
  if (factor.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
  const Eigen::VectorXd alpha = factor.solve(outputs_);
  const Eigen::MatrixXd inverse = Solved(factor, Eigen::MatrixXd::Identity(n, n));
  double value = 0.5 * outputs_.dot(alpha);
  for (Index i = 0; i < n; ++i) value += std::log(factor.matrixLLT()(i, i));

  // dV/dx = 1/2 tr((K^-1 - alpha alpha^T) dK/dx); the pairs stand for both triangles.
  Eigen::ArrayXd sensitivity(z.size());
  pair = 0;
  for (Index j = 0; j < n; ++j) {
    const Index below = n - 1 - j;
    sensitivity.segment(pair, below) = inverse.col(j).tail(below) - alpha[j] * alpha.tail(below);
    pair += below;
  }
  const double diagonal = inverse.trace() - alpha.squaredNorm();
  // dk/d ln l_j = s 5/3 (1 + sqrt5 r) exp(-sqrt5 r) (x_j - x'_j)^2 / l_j^2
  const Eigen::VectorXd slope = (sensitivity * (5 * signal / 3) * (1 + z) * decay).matrix();
  gradient.head(d) = (squared_.transpose() * slope).cwiseProduct(weights);
  gradient[d] = signal * ((sensitivity * matern).sum() + 0.5 * diagonal);
  gradient[d + 1] = 0.5 * scatter * diagonal;
  if (grouped) gradient[d + 2] = group * ((sensitivity * together_).sum() + 0.5 * diagonal);

  for (Index j = 0; j < x.size(); ++j) {
    const LogPrior prior = HyperPrior(j, d);
    const double deviation = (x[j] - prior.mean) / prior.sd;
    value += 0.5 * deviation * deviation;
    gradient[j] += deviation / prior.sd;
  }
  return value;
}

}  // namespace calib::inference
