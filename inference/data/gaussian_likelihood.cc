#include "inference/data/gaussian_likelihood.h"

#include <algorithm>
#include <boost/math/special_functions/gamma.hpp>
#include <cassert>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"

namespace calib::inference {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
const double kLogSqrtTwoPi = 0.5 * std::log(2 * std::numbers::pi);

// Lower Cholesky factor of Sigma; its smallest pivot tells how much of the last reading the earlier
// ones leave open.
absl::StatusOr<Eigen::MatrixXd> CorrelatedCholesky(const DataSet& data, std::pair<int, int> key,
                                                   const std::vector<int>& members) {
  const Eigen::MatrixXd correlation = ErrorCorrelation(data, key, members);
  const Eigen::Index size = correlation.rows();
  Eigen::MatrixXd factor = Eigen::MatrixXd::Zero(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) {
      double value = correlation(i, j);
      for (Eigen::Index k = 0; k < j; ++k) value -= factor(i, k) * factor(j, k);
      if (i > j) {
        factor(i, j) = value / factor(j, j);
      } else if (value > 1e-13) {
        factor(i, i) = std::sqrt(value);
      } else {
        return absl::InvalidArgumentError(absl::StrCat(
            "the errors of the readings of observable ", key.second, " of experiment ", key.first,
            " have a singular covariance: the one near the control ",
            data.readings[members[i]].control,
            " follows from those before it; leave out readings that lie too close together."));
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
  for (const Reading& reading : data.readings) likelihood.values_.push_back(reading.value);

  for (auto& [key, indices] : GroupsOf(data)) {
    Group group;
    const auto size = static_cast<Eigen::Index>(indices.size());
    if (IsCorrelated(data, key)) {
      auto factor = CorrelatedCholesky(data, key, indices);
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
    group.log_constant.resize(size);
    for (Eigen::Index k = 0; k < size; ++k) {
      // ln Gamma(after) - ln Gamma(before), without the cancellation of their difference.
      const double before = likelihood.factor_prior_.shape + 0.5 * static_cast<double>(k);
      group.log_constant[k] = -kLogSqrtTwoPi - group.log_diagonal[k] -
                              std::log(boost::math::tgamma_delta_ratio(before, 0.5));
    }
    group.readings = indices;
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
  const double before = factor_prior_.shape + 0.5 * k;
  const double after = before + 0.5;
  return group.log_constant[k] + before * std::log(factor_prior_.rate + 0.5 * square_before) -
         after * std::log(factor_prior_.rate + 0.5 * square_after);
}

// Column by column: every operation is on one element of a column at a time, so that a row's bits
// do not depend on the other rows.
Eigen::MatrixXd GaussianLikelihood::Fill(const Eigen::MatrixXd& predictions,
                                         Missing missing) const {
  assert(predictions.cols() == readings_);
  const Eigen::Index n = predictions.rows();
  Eigen::MatrixXd increments(n, readings_);
  std::vector<char> reached(static_cast<std::size_t>(n));
  std::vector<double> square(static_cast<std::size_t>(inferred_ ? n : 0));
  Eigen::MatrixXd whitened;  // z of a correlated group's readings so far
  Eigen::VectorXd z(n);
  for (const Group& group : groups_) {
    const bool correlated = group.cholesky.size() > 0;
    const auto size = static_cast<Eigen::Index>(group.readings.size());
    if (correlated) whitened.resize(n, size);
    std::fill(reached.begin(), reached.end(), 1);
    std::fill(square.begin(), square.end(), 0.0);
    for (Eigen::Index k = 0; k < size; ++k) {
      const int t = group.readings[static_cast<std::size_t>(k)];
      z = values_[static_cast<std::size_t>(t)] - predictions.col(t).array();
      for (Eigen::Index i = 0; i < n; ++i) {
        char& row = reached[static_cast<std::size_t>(i)];
        row = static_cast<char>(row & static_cast<char>(std::isfinite(z[i])));
        if (row == 0) z[i] = 0;
      }
      if (correlated) {  // forward substitution
        for (Eigen::Index l = 0; l < k; ++l) z -= group.cholesky(k, l) * whitened.col(l);
        z /= group.cholesky(k, k);
        for (Eigen::Index i = 0; i < n; ++i) {
          if (reached[static_cast<std::size_t>(i)] == 0) z[i] = 0;
        }
        whitened.col(k) = z;
      } else {
        z *= group.inverse_sd[k];
      }
      auto out = increments.col(t);
      if (!inferred_) {
        out = (-kLogSqrtTwoPi - group.log_diagonal[k]) - 0.5 * z.array().square();
      } else {
        for (Eigen::Index i = 0; i < n; ++i) {
          double& before = square[static_cast<std::size_t>(i)];
          const double after = before + z[i] * z[i];
          out[i] = LogFactor(group, static_cast<int>(k), before, after);
          before = after;
        }
      }
      if (missing == Missing::kZeroResidual) continue;
      for (Eigen::Index i = 0; i < n; ++i) {
        if (reached[static_cast<std::size_t>(i)] == 0) out[i] = kNaN;
      }
    }
  }
  return increments;
}

Eigen::MatrixXd GaussianLikelihood::Increments(const Eigen::MatrixXd& predictions) const {
  return Fill(predictions, Missing::kStop);
}

Eigen::VectorXd GaussianLikelihood::Sum(const Eigen::MatrixXd& increments) {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(increments.rows());
  for (const auto& column : increments.colwise()) sum += column;
  return sum.unaryExpr([](double value) { return std::isnan(value) ? -kInfinity : value; });
}

Eigen::VectorXd GaussianLikelihood::LogLikelihood(const Eigen::MatrixXd& predictions) const {
  return Sum(Increments(predictions));
}

Eigen::VectorXd GaussianLikelihood::ReachedLogLikelihood(const Eigen::MatrixXd& predictions) const {
  return Sum(Increments(predictions).unaryExpr([](double value) {
    return std::isnan(value) ? 0.0 : value;
  }));
}

Eigen::VectorXd GaussianLikelihood::LogLikelihoodBound(const Eigen::MatrixXd& predictions) const {
  return Sum(Fill(predictions, Missing::kZeroResidual));
}

}  // namespace calib::inference
