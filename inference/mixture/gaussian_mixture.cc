#include "inference/mixture/gaussian_mixture.h"

#include <cassert>
#include <cmath>
#include <numbers>

#include "inference/mixture/box_probability.h"
#include "inference/numerics/decompositions.h"
#include "inference/numerics/log_weights.h"

namespace calib::inference {

std::vector<MixtureComponent> MarginalOfFirst(std::span<const MixtureComponent> components,
                                              Eigen::Index dimensions) {
  std::vector<MixtureComponent> marginal;
  for (const MixtureComponent& joint : components) {
    assert(dimensions > 0 && dimensions <= joint.mean.size());
    marginal.push_back({.weight = joint.weight,
                        .mean = joint.mean.head(dimensions),
                        .covariance = joint.covariance.topLeftCorner(dimensions, dimensions)});
  }
  return marginal;
}

GaussianMixture::GaussianMixture(std::span<const MixtureComponent> components) {
  assert(!components.empty());
  double total = 0;
  for (const MixtureComponent& component : components) total += component.weight;
  for (const MixtureComponent& component : components) {
    const Eigen::LLT<Eigen::MatrixXd> factor(component.covariance);
    assert(factor.info() == Eigen::Success);
    Eigen::MatrixXd lower = factor.matrixL();
    double log_determinant = 0;
    for (Eigen::Index i = 0; i < lower.rows(); ++i) log_determinant += std::log(lower(i, i));
    const double dimensions = static_cast<double>(lower.rows());
    components_.push_back(
        {.log_weight = std::log(component.weight / total),
         .log_normaliser = -0.5 * dimensions * std::log(2 * std::numbers::pi) - log_determinant,
         .mean = component.mean,
         .cholesky = std::move(lower)});
  }
}

double GaussianMixture::LogDensity(const Eigen::VectorXd& x) const {
  Eigen::VectorXd terms(static_cast<Eigen::Index>(components_.size()));
  for (std::size_t k = 0; k < components_.size(); ++k) {
    const Factorised& c = components_[k];
    const Eigen::VectorXd z = c.cholesky.triangularView<Eigen::Lower>().solve(x - c.mean);
    terms[static_cast<Eigen::Index>(k)] = c.log_weight + c.log_normaliser - 0.5 * z.squaredNorm();
  }
  return LogSumExp(terms);
}

Eigen::VectorXd GaussianMixture::Draw(PhiloxStream& stream) const {
  double remaining = stream.Uniform();
  std::size_t chosen = 0;
  for (; chosen + 1 < components_.size(); ++chosen) {
    remaining -= std::exp(components_[chosen].log_weight);
    if (remaining < 0) break;
  }
  const Factorised& c = components_[chosen];
  Eigen::VectorXd z(c.mean.size());
  for (double& value : z) value = stream.Normal();
  return c.mean + c.cholesky.triangularView<Eigen::Lower>() * z;
}

double GaussianMixture::LogBoxMass(const Eigen::VectorXd& low, const Eigen::VectorXd& high) const {
  Eigen::VectorXd terms(static_cast<Eigen::Index>(components_.size()));
  for (std::size_t k = 0; k < components_.size(); ++k) {
    const Factorised& c = components_[k];
    terms[static_cast<Eigen::Index>(k)] =
        c.log_weight + std::log(BoxProbability(c.cholesky, low - c.mean, high - c.mean));
  }
  return LogSumExp(terms);
}

}  // namespace calib::inference
