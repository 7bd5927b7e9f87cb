#include "inference/numerics/weighted_moments.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <vector>

namespace calib::inference {

Eigen::VectorXd WeightedMean(const Eigen::VectorXd& log_weights, const Eigen::MatrixXd& values) {
  assert(values.rows() == log_weights.size() && values.rows() > 0);
  const Eigen::VectorXd origin = values.row(0);
  Eigen::VectorXd shift = Eigen::VectorXd::Zero(values.cols());
  for (Eigen::Index i = 0; i < values.rows(); ++i) {
    const double weight = std::exp(log_weights[i]);
    if (weight == 0) continue;
    for (Eigen::Index j = 0; j < values.cols(); ++j)
      shift[j] += weight * (values(i, j) - origin[j]);
  }
  return origin + shift;
}

Eigen::MatrixXd WeightedCovariance(const Eigen::VectorXd& log_weights,
                                   const Eigen::MatrixXd& values, const Eigen::VectorXd& mean) {
  assert(values.rows() == log_weights.size() && values.cols() == mean.size());
  const Eigen::Index d = values.cols();
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(d, d);
  for (Eigen::Index i = 0; i < values.rows(); ++i) {
    const double weight = std::exp(log_weights[i]);
    if (weight == 0) continue;
    for (Eigen::Index j = 0; j < d; ++j) {
      const double scaled = weight * (values(i, j) - mean[j]);
      for (Eigen::Index k = 0; k <= j; ++k) covariance(j, k) += scaled * (values(i, k) - mean[k]);
    }
  }
  return covariance.selfadjointView<Eigen::Lower>();
}

Eigen::MatrixXd CorrelationOf(const Eigen::MatrixXd& covariance) {
  const Eigen::Index d = covariance.rows();
  Eigen::MatrixXd correlation = Eigen::MatrixXd::Identity(d, d);
  for (Eigen::Index j = 0; j < d; ++j) {
    for (Eigen::Index k = 0; k < d; ++k) {
      const double scale = std::sqrt(covariance(j, j)) * std::sqrt(covariance(k, k));
      if (j != k)
        correlation(j, k) = scale > 0 ? std::clamp(covariance(j, k) / scale, -1.0, 1.0) : 0;
    }
  }
  return correlation;
}

double WeightedQuantile(const Eigen::VectorXd& log_weights, const Eigen::VectorXd& values,
                        double p) {
  return WeightedQuantiles(log_weights, values, {p}).front();
}

std::vector<double> WeightedQuantiles(const Eigen::VectorXd& log_weights,
                                      const Eigen::VectorXd& values, const std::vector<double>& p) {
  assert(values.size() == log_weights.size() && std::is_sorted(p.begin(), p.end()));
  struct Sample {
    double value, weight;
  };
  std::vector<Sample> samples;
  samples.reserve(static_cast<std::size_t>(values.size()));
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const double weight = std::exp(log_weights[i]);
    if (weight > 0) samples.push_back({.value = values[i], .weight = weight});
  }
  std::vector<double> quantiles;
  if (samples.empty()) {
    quantiles.assign(p.size(), std::numeric_limits<double>::quiet_NaN());
    return quantiles;
  }
  std::stable_sort(samples.begin(), samples.end(),
                   [](const Sample& a, const Sample& b) { return a.value < b.value; });
  double before = 0;
  double last_position = 0;
  double last_value = samples.front().value;
  for (const Sample& sample : samples) {
    const double position = before + 0.5 * sample.weight;
    const double span = position - last_position;
    while (quantiles.size() < p.size() && position >= p[quantiles.size()]) {
      const double share = span > 0 ? (p[quantiles.size()] - last_position) / span : 1;
      quantiles.push_back(last_value + (sample.value - last_value) * share);
    }
    before += sample.weight;
    last_position = position;
    last_value = sample.value;
  }
  quantiles.resize(p.size(), last_value);
  return quantiles;
}

}  // namespace calib::inference
