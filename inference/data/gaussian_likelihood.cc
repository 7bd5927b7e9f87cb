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

// No early exit, so that it is vectorised: 0 x is NaN for what is not finite.
bool AllFinite(const Eigen::Ref<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>& values) {
  double sum = 0;
  for (const auto& column : values.colwise()) sum += (0.0 * column).sum();
  return sum == 0;
}

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
  likelihood.log_diagonal_.resize(likelihood.readings_);
  likelihood.inverse_sd_.resize(likelihood.readings_);
  for (int t = 0; t < likelihood.readings_; ++t)
    likelihood.inverse_sd_[t] = 1 / data.readings[static_cast<std::size_t>(t)].sd;
  likelihood.is_plain_ = !likelihood.inferred_;

  for (const auto& [key, indices] : GroupsOf(data)) {
    Group group;
    if (IsCorrelated(data, key)) {
      auto factor = CorrelatedCholesky(data, key, indices);
      if (!factor.ok()) return factor.status();
      for (Eigen::Index k = 0; k < factor->rows(); ++k)
        likelihood.log_diagonal_[indices[static_cast<std::size_t>(k)]] = std::log((*factor)(k, k));
      group.cholesky = *std::move(factor);
      likelihood.is_plain_ = false;
    } else {
      for (const int t : indices) likelihood.log_diagonal_[t] = std::log(data.readings[t].sd);
    }
    group.readings = indices;
    likelihood.groups_.push_back(std::move(group));
  }
  if (!likelihood.inferred_) return likelihood;
  const ReadingGroups readings = GroupsOf(data);
  for (const NoiseGroup& shared : NoiseGroupsOf(data)) {
    FactorGroup factor{.prior = shared.prior, .readings = {}, .log_constant = {}};
    for (const auto& member : shared.members) {
      const std::vector<int>& of_member = readings.at(member);
      factor.readings.insert(factor.readings.end(), of_member.begin(), of_member.end());
    }
    std::sort(factor.readings.begin(), factor.readings.end());
    factor.log_constant.resize(static_cast<Eigen::Index>(factor.readings.size()));
    for (Eigen::Index k = 0; k < factor.log_constant.size(); ++k) {
      // Without the cancellation of the difference.
      const double before = shared.prior.shape + 0.5 * static_cast<double>(k);
      factor.log_constant[k] = -std::log(boost::math::tgamma_delta_ratio(before, 0.5));
    }
    likelihood.factors_.push_back(std::move(factor));
  }
  return likelihood;
}

// Column by column: every operation is on one element of a column at a time, so that a row's bits
// do not depend on the other rows.
void GaussianLikelihood::Whiten(const Rows& predictions, Missing missing, MutableRows z_all) const {
  assert(predictions.cols() == readings_);
  const Eigen::Index n = predictions.rows();
  const bool complete = AllFinite(predictions);
  std::vector<char> reached(static_cast<std::size_t>(n));
  for (const Group& group : groups_) {
    const bool correlated = group.cholesky.size() > 0;
    const auto size = static_cast<Eigen::Index>(group.readings.size());
    std::fill(reached.begin(), reached.end(), 1);
    for (Eigen::Index k = 0; k < size; ++k) {
      const int t = group.readings[static_cast<std::size_t>(k)];
      auto z = z_all.col(t);
      z = values_[static_cast<std::size_t>(t)] - predictions.col(t).array();
      for (Eigen::Index i = 0; !complete && i < n; ++i) {
        char& row = reached[static_cast<std::size_t>(i)];
        row = static_cast<char>(row & static_cast<char>(std::isfinite(z[i])));
        if (row == 0) z[i] = 0;
      }
      if (!correlated) {
        z *= inverse_sd_[t];
        continue;
      }
      for (Eigen::Index l = 0; l < k; ++l) {  // forward substitution
        z -= group.cholesky(k, l) * z_all.col(group.readings[static_cast<std::size_t>(l)]);
      }
      z /= group.cholesky(k, k);
      for (Eigen::Index i = 0; !complete && i < n; ++i) {
        if (reached[static_cast<std::size_t>(i)] == 0) z[i] = 0;
      }
    }
    if (complete || missing == Missing::kZeroResidual) continue;
    std::fill(reached.begin(), reached.end(), 1);
    for (const int t : group.readings) {
      for (Eigen::Index i = 0; i < n; ++i) {
        char& row = reached[static_cast<std::size_t>(i)];
        row = static_cast<char>(row & static_cast<char>(std::isfinite(predictions(i, t))));
        if (row == 0) z_all(i, t) = kNaN;
      }
    }
  }
}

// z of the group's readings to their increments: the ratio of two multivariate t densities of k + 1
// and k readings, k those of the row so far,
//   M_n = rate^a Gamma(a + n/2) / Gamma(a) (2 pi)^(-n/2) |L|^-1 (rate + q_n/2)^-(a + n/2).
void GaussianLikelihood::IntegrateFactor(const FactorGroup& group, MutableRows z) const {
  const Eigen::Index n = z.rows();
  std::vector<int> count(static_cast<std::size_t>(n), 0);
  std::vector<double> square(static_cast<std::size_t>(n), 0.0);
  std::vector<double> log_rate(static_cast<std::size_t>(n), std::log(group.prior.rate));
  for (const int t : group.readings) {
    const double constant = -kLogSqrtTwoPi - log_diagonal_[t];
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto row = static_cast<std::size_t>(i);
      double& value = z(i, t);
      if (std::isnan(value)) continue;
      square[row] += value * value;
      const double before = group.prior.shape + 0.5 * count[row];
      const double log_after = std::log(group.prior.rate + 0.5 * square[row]);
      value = constant + group.log_constant[count[row]] + before * log_rate[row] -
              (before + 0.5) * log_after;
      log_rate[row] = log_after;
      ++count[row];
    }
  }
}

Eigen::MatrixXd GaussianLikelihood::Fill(const Eigen::MatrixXd& predictions,
                                         Missing missing) const {
  Eigen::MatrixXd increments(predictions.rows(), readings_);
  if (is_plain_ && AllFinite(predictions)) {
    for (int t = 0; t < readings_; ++t) {
      increments.col(t) =
          (-kLogSqrtTwoPi - log_diagonal_[t]) -
          0.5 *
              ((values_[static_cast<std::size_t>(t)] - predictions.col(t).array()) * inverse_sd_[t])
                  .square();
    }
    return increments;
  }
  constexpr Eigen::Index kBlock = 256;  // rows whose columns stay in the cache
  for (Eigen::Index first = 0; first < predictions.rows(); first += kBlock) {
    const Eigen::Index size = std::min(kBlock, predictions.rows() - first);
    MutableRows block = increments.middleRows(first, size);
    Whiten(predictions.middleRows(first, size), missing, block);
    for (const FactorGroup& group : factors_) IntegrateFactor(group, block);
    for (int t = 0; !inferred_ && t < readings_; ++t) {
      auto column = block.col(t).array();
      column = (-kLogSqrtTwoPi - log_diagonal_[t]) - 0.5 * column.square();
    }
  }
  return increments;
}

GaussianLikelihood::FactorPosterior GaussianLikelihood::VarianceFactors(
    const Eigen::MatrixXd& predictions) const {
  Eigen::MatrixXd z(predictions.rows(), readings_);
  Whiten(predictions, Missing::kStop, z);
  FactorPosterior factors{
      .shapes = Eigen::VectorXd(static_cast<Eigen::Index>(factors_.size())),
      .rates = Eigen::MatrixXd(z.rows(), static_cast<Eigen::Index>(factors_.size()))};
  for (Eigen::Index g = 0; g < factors.shapes.size(); ++g) {
    const FactorGroup& group = factors_[static_cast<std::size_t>(g)];
    factors.shapes[g] = group.prior.shape + 0.5 * static_cast<double>(group.readings.size());
    factors.rates.col(g).setConstant(group.prior.rate);
    for (const int t : group.readings) factors.rates.col(g) += 0.5 * z.col(t).cwiseAbs2();
  }
  return factors;
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
