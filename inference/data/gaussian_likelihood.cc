#include "inference/data/gaussian_likelihood.h"

#include <boost/math/special_functions/gamma.hpp>
#include <cassert>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"

namespace calib::inference {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
const double kLogSqrtTwoPi = 0.5 * std::log(2 * std::numbers::pi);

// Lower Cholesky factor of S; its smallest pivot tells how much of the last reading the earlier
// ones leave open.
absl::StatusOr<Eigen::MatrixXd> CorrelatedCholesky(const DataSet& data,
                                                   const std::vector<int>& members, double length) {
  const auto size = static_cast<Eigen::Index>(members.size());
  Eigen::MatrixXd factor = Eigen::MatrixXd::Zero(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    const Reading& row = data.readings[members[i]];
    for (Eigen::Index j = 0; j <= i; ++j) {
      const Reading& column = data.readings[members[j]];
      double value = std::exp(-std::abs(row.control - column.control) / length);
      for (Eigen::Index k = 0; k < j; ++k) value -= factor(i, k) * factor(j, k);
      if (i > j) {
        factor(i, j) = value / factor(j, j);
      } else if (value > 1e-13) {
        factor(i, i) = std::sqrt(value);
      } else {
        return absl::InvalidArgumentError(absl::StrCat(
            "readings of observable ", row.observable, " of experiment ", row.experiment,
            " near the control ", row.control, " lie too close for the correlation length ", length,
            ": leave out some of them."));
      }
    }
  }
  for (Eigen::Index i = 0; i < size; ++i) factor.row(i) *= data.readings[members[i]].sd;
  return factor;
}

}  // namespace

absl::StatusOr<GaussianLikelihood> GaussianLikelihood::Create(const DataSet& data,
                                                              NoiseMode noise) {
  assert(noise != NoiseMode::kEssTarget);
  if (auto valid = ValidateData(data, noise); !valid.ok()) return valid;
  GaussianLikelihood likelihood;
  likelihood.readings_ = static_cast<int>(data.readings.size());
  likelihood.inferred_ = noise == NoiseMode::kInferred;
  std::map<std::pair<int, int>, std::vector<int>> members;
  for (int t = 0; t < likelihood.readings_; ++t) {
    const Reading& reading = data.readings[t];
    likelihood.values_.push_back(reading.value);
    members[{reading.experiment, reading.observable}].push_back(t);
  }
  std::map<std::pair<int, int>, double> lengths;
  for (const Correlation& c : data.correlations) lengths[{c.experiment, c.observable}] = c.length;

  for (auto& [key, indices] : members) {
    Group group;
    const auto size = static_cast<Eigen::Index>(indices.size());
    const auto length = lengths.find(key);
    if (length != lengths.end()) {
      auto factor = CorrelatedCholesky(data, indices, length->second);
      if (!factor.ok()) return factor.status();
      group.log_diagonal = factor->diagonal().array().log();
      group.cholesky = *std::move(factor);
    } else {
      group.log_diagonal.resize(size);
      group.inverse_sd.resize(size);
      for (Eigen::Index k = 0; k < size; ++k) {
        group.log_diagonal[k] = std::log(data.readings[indices[k]].sd);
        group.inverse_sd[k] = 1 / data.readings[indices[k]].sd;
      }
    }
    group.readings = std::move(indices);
    likelihood.groups_.push_back(std::move(group));
  }
  return likelihood;
}

// ln of the conditional density of reading k of its group (from 0), z_k^2 = square_after -
// square_before, where the squares are sums of z^2. With the factor integrated out, the ratio of
// two multivariate t densities of k + 1 and k readings:  M_n = rate^a Gamma(a + n/2) / Gamma(a) (2
// pi)^(-n/2) |L|^-1 (rate + q_n/2)^-(a + n/2).
double GaussianLikelihood::LogFactor(const Group& group, int k, double square_before,
                                     double square_after) const {
  const double normaliser = -kLogSqrtTwoPi - group.log_diagonal[k];
  if (!inferred_) return normaliser - 0.5 * (square_after - square_before);
  const double before = factor_prior_.shape + 0.5 * k;
  const double after = before + 0.5;
  // ln Gamma(after) - ln Gamma(before), without the cancellation of their difference.
  const double gamma_ratio = -std::log(boost::math::tgamma_delta_ratio(before, 0.5));
  return normaliser + gamma_ratio + before * std::log(factor_prior_.rate + 0.5 * square_before) -
         after * std::log(factor_prior_.rate + 0.5 * square_after);
}

void GaussianLikelihood::Scan(const Eigen::MatrixXd& predictions, Eigen::Index row, Missing missing,
                              std::vector<double>& increments) const {
  increments.assign(readings_, kNaN);
  std::vector<double> z;
  for (const Group& group : groups_) {
    z.clear();
    double square = 0;
    bool reached = true;
    for (int k = 0; k < static_cast<int>(group.readings.size()); ++k) {
      const int t = group.readings[k];
      const double residual = values_[t] - predictions(row, t);
      reached = reached && std::isfinite(residual);
      if (!reached && missing == Missing::kStop) break;
      double whitened = 0;
      if (reached && group.cholesky.size() == 0) {
        whitened = residual * group.inverse_sd[k];
      } else if (reached) {
        whitened = residual;  // forward substitution, one row
        for (int l = 0; l < k; ++l) whitened -= group.cholesky(k, l) * z[l];
        whitened /= group.cholesky(k, k);
        z.push_back(whitened);
      }
      const double after = square + whitened * whitened;
      increments[t] = inferred_ ? LogFactor(group, k, square, after)
                                : LogFactor(group, k, 0, whitened * whitened);
      square = after;
    }
  }
}

Eigen::MatrixXd GaussianLikelihood::Increments(const Eigen::MatrixXd& predictions) const {
  assert(predictions.cols() == readings_);
  Eigen::MatrixXd result(predictions.rows(), readings_);
  std::vector<double> increments;
  for (Eigen::Index i = 0; i < predictions.rows(); ++i) {
    Scan(predictions, i, Missing::kStop, increments);
    for (int t = 0; t < readings_; ++t) result(i, t) = increments[t];
  }
  return result;
}

Eigen::VectorXd GaussianLikelihood::LogLikelihood(const Eigen::MatrixXd& predictions) const {
  assert(predictions.cols() == readings_);
  Eigen::VectorXd result(predictions.rows());
  std::vector<double> increments;
  for (Eigen::Index i = 0; i < predictions.rows(); ++i) {
    Scan(predictions, i, Missing::kStop, increments);
    double sum = 0;
    for (const double increment : increments) sum += increment;
    result[i] = std::isnan(sum) ? -kInfinity : sum;
  }
  return result;
}

Eigen::VectorXd GaussianLikelihood::ReachedLogLikelihood(const Eigen::MatrixXd& predictions) const {
  assert(predictions.cols() == readings_);
  Eigen::VectorXd result(predictions.rows());
  std::vector<double> increments;
  for (Eigen::Index i = 0; i < predictions.rows(); ++i) {
    Scan(predictions, i, Missing::kStop, increments);
    double sum = 0;
    for (const double increment : increments) sum += std::isnan(increment) ? 0 : increment;
    result[i] = sum;
  }
  return result;
}

Eigen::VectorXd GaussianLikelihood::LogLikelihoodBound(const Eigen::MatrixXd& predictions) const {
  assert(predictions.cols() == readings_);
  Eigen::VectorXd result(predictions.rows());
  std::vector<double> increments;
  for (Eigen::Index i = 0; i < predictions.rows(); ++i) {
    Scan(predictions, i, Missing::kZeroResidual, increments);
    double sum = 0;
    for (const double increment : increments) sum += increment;
    result[i] = sum;
  }
  return result;
}

}  // namespace calib::inference
