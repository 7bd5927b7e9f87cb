#include "inference/filter/weighted_moments.h"

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
  assert(values.size() == log_weights.size());
  std::vector<Eigen::Index> order;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    if (std::exp(log_weights[i]) > 0) order.push_back(i);
  }
  if (order.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::stable_sort(order.begin(), order.end(),
                   [&](Eigen::Index a, Eigen::Index b) { return values[a] < values[b]; });
  double before = 0;
  double last_position = 0;
  double last_value = values[order.front()];
  for (const Eigen::Index i : order) {
    const double weight = std::exp(log_weights[i]);
    const double position = before + 0.5 * weight;
    if (position >= p) {
      const double span = position - last_position;
      return span > 0 ? last_value + (values[i] - last_value) * (p - last_position) / span
                      : values[i];
    }
    before += weight;
    last_position = position;
    last_value = values[i];
  }
  return last_value;
}

}  // namespace calib::inference
