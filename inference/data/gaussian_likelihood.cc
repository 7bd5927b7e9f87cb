#include "inference/data/gaussian_likelihood.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/numerics/infinity.h"
#include "inference/numerics/special_functions.h"
#include "inference/numerics/wide_exponential.h"

namespace calib::inference {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
const double kHalfLogTwoPi = 0.5 * std::log(2 * std::numbers::pi);

// No early exit, so that it is vectorised: 0 x is NaN for what is not finite.
bool AllFinite(const Eigen::Ref<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>& values) {
  double sum = 0;
  for (const auto& column : values.colwise()) sum += (0.0 * column).sum();
  return sum == 0;
}

absl::Status Singular(const DataSet& data, std::pair<int, int> key, int reading) {
  return absl::InvalidArgumentError(absl::StrCat(
      "the errors of the readings of observable ", key.second, " of experiment ", key.first,
      " have a singular covariance: the one near the control ",
      data.readings[static_cast<std::size_t>(reading)].control,
      " follows from those before it; leave out readings that lie too close together."));
}

// Lower Cholesky factor of a correlation matrix, up to the first reading that the earlier ones
// leave too little of (its index is returned; no such: the number of readings).
Eigen::Index Factorise(const Eigen::MatrixXd& correlation, Eigen::MatrixXd& factor,
                       Eigen::VectorXd& open) {
  const Eigen::Index size = correlation.rows();
  factor = correlation.triangularView<Eigen::Lower>();
  open = Eigen::VectorXd::Zero(size);
  for (Eigen::Index j = 0; j < size; ++j) {
    const Eigen::Index below = size - j;
    for (Eigen::Index k = 0; k < j; ++k) {
      factor.col(j).tail(below) -= factor(j, k) * factor.col(k).tail(below);
    }
    open[j] = factor(j, j);
    if (!(open[j] > kLeastOpenShare)) return j;
    factor(j, j) = std::sqrt(open[j]);
    factor.col(j).tail(below - 1) /= factor(j, j);
  }
  return size;
}

// Lower Cholesky factor of Sigma.
absl::StatusOr<Eigen::MatrixXd> CorrelatedCholesky(const DataSet& data, std::pair<int, int> key,
                                                   const std::vector<int>& members) {
  Eigen::MatrixXd factor;
  Eigen::VectorXd open;
  const Eigen::Index factorised = Factorise(ErrorCorrelation(data, key, members), factor, open);
  if (factorised < factor.rows()) {
    return Singular(data, key, members[static_cast<std::size_t>(factorised)]);
  }
  for (Eigen::Index i = 0; i < factor.rows(); ++i)
    factor.row(i) *= data.readings[static_cast<std::size_t>(members[i])].sd;
  return factor;
}

// The length of exponential correlation where it makes a chain of the readings, whose control then
// only grows or only falls; 0: independent errors, or a covariance that is no chain.
double ChainLength(const DataSet& data, std::pair<int, int> key, const std::vector<int>& members) {
  const auto length = std::find_if(
      data.correlations.begin(), data.correlations.end(),
      [&key](const auto& c) { return c.experiment == key.first && c.observable == key.second; });
  if (length == data.correlations.end()) return 0;
  const auto control = [&data, &members](std::size_t k) {
    return data.readings[static_cast<std::size_t>(members[k])].control;
  };
  for (std::size_t k = 2; k < members.size(); ++k) {
    if ((control(k) > control(k - 1)) != (control(1) > control(0))) return 0;
  }
  return length->length;
}

// sum <- sum - factor * the eight numbers from there on.
[[gnu::always_inline]] inline void Subtract(double factor, const double* from, Lanes& sum) {
  Lanes term;
  std::memcpy(&term, from, sizeof(term));
  sum -= factor * term;
}

constexpr Eigen::Index kEight = kLanes;  // as a difference of pointers

// z <- z - sum_l factors_l earlier_l over n samples, the terms in order; four times eight samples
// stay in registers until all terms are taken off.
CALIB_INFERENCE_CLONES void SubtractEarlier(const double* factors, const double* const* earlier,
                                            Eigen::Index terms, Eigen::Index n, double* z) {
  Eigen::Index i = 0;
  for (; i + 4 * kEight <= n; i += 4 * kEight) {
    Lanes first;
    Lanes second;
    Lanes third;
    Lanes fourth;
    std::memcpy(&first, z + i, sizeof(Lanes));
    std::memcpy(&second, z + i + kEight, sizeof(Lanes));
    std::memcpy(&third, z + i + 2 * kEight, sizeof(Lanes));
    std::memcpy(&fourth, z + i + 3 * kEight, sizeof(Lanes));
    for (Eigen::Index l = 0; l < terms; ++l) {
      const double* of_term = earlier[l] + i;
      Subtract(factors[l], of_term, first);
      Subtract(factors[l], of_term + kEight, second);
      Subtract(factors[l], of_term + 2 * kEight, third);
      Subtract(factors[l], of_term + 3 * kEight, fourth);
    }
    std::memcpy(z + i, &first, sizeof(Lanes));
    std::memcpy(z + i + kEight, &second, sizeof(Lanes));
    std::memcpy(z + i + 2 * kEight, &third, sizeof(Lanes));
    std::memcpy(z + i + 3 * kEight, &fourth, sizeof(Lanes));
  }
  for (; i < n; ++i) {
    for (Eigen::Index l = 0; l < terms; ++l) z[i] -= factors[l] * earlier[l][i];
  }
}

// SubtractEarlier for kRows readings at once, which load each earlier one together. Chosen: so many
// sums, a factor and a term fit into sixteen vector registers.
constexpr Eigen::Index kRows = 6;
CALIB_INFERENCE_CLONES void SubtractEarlierFromRows(const double* const* factors,
                                                    const double* const* earlier,
                                                    Eigen::Index terms, Eigen::Index n,
                                                    double* const* z) {
  Eigen::Index i = 0;
  for (; i + kLanes <= n; i += kLanes) {
    Lanes sum[kRows];
#pragma GCC unroll 6
    for (Eigen::Index r = 0; r < kRows; ++r) std::memcpy(&sum[r], z[r] + i, sizeof(Lanes));
    for (Eigen::Index l = 0; l < terms; ++l) {
#pragma GCC unroll 6
      for (Eigen::Index r = 0; r < kRows; ++r) Subtract(factors[r][l], earlier[l] + i, sum[r]);
    }
#pragma GCC unroll 6
    for (Eigen::Index r = 0; r < kRows; ++r) std::memcpy(z[r] + i, &sum[r], sizeof(Lanes));
  }
  for (; i < n; ++i) {
    for (Eigen::Index r = 0; r < kRows; ++r) {
      for (Eigen::Index l = 0; l < terms; ++l) z[r][i] -= factors[r][l] * earlier[l][i];
    }
  }
}

}  // namespace

OpenShare LeastOpenShare(const Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd inverse = covariance.diagonal().cwiseSqrt().cwiseInverse();
  Eigen::MatrixXd factor;
  Eigen::VectorXd open;
  const Eigen::Index factorised =
      Factorise(inverse.asDiagonal() * covariance * inverse.asDiagonal(), factor, open);
  OpenShare least{.reading = factorised};
  if (factorised == covariance.rows()) {
    least.share = open.minCoeff(&least.reading);
  } else {
    least.share = open[factorised];
  }
  return least;
}

absl::StatusOr<GaussianLikelihood> GaussianLikelihood::Create(const DataSet& data,
                                                              NoiseMode noise) {
  assert(noise != NoiseMode::kEssTarget);
  RETURN_IF_ERROR(ValidateData(data, noise));
  GaussianLikelihood likelihood;
  likelihood.readings_ = static_cast<int>(data.readings.size());
  likelihood.inferred_ = noise == NoiseMode::kInferred;
  for (const Reading& reading : data.readings) likelihood.values_.push_back(reading.value);
  likelihood.log_diagonal_ = Eigen::VectorXd::Zero(likelihood.readings_);
  likelihood.links_.resize(data.readings.size());
  likelihood.is_plain_ = noise == NoiseMode::kGiven;

  std::set<std::pair<int, int>> with_levels;
  if (noise == NoiseMode::kModelError) {
    RETURN_IF_ERROR(likelihood.AddLevels(data));
    for (const ModelError& error : data.model_errors) {
      with_levels.insert(error.members.begin(), error.members.end());
    }
  }
  for (const auto& [key, indices] : GroupsOf(data)) {
    if (with_levels.contains(key)) continue;
    Group group;
    const double length = ChainLength(data, key, indices);
    if (IsCorrelated(data, key) && length == 0) {
      ASSIGN_OR_RETURN(auto factor, CorrelatedCholesky(data, key, indices));
      for (Eigen::Index k = 0; k < factor.rows(); ++k)
        likelihood.log_diagonal_[indices[static_cast<std::size_t>(k)]] = std::log(factor(k, k));
      group.cholesky = factor;  // its rows where columns were
      likelihood.is_plain_ = false;
    } else {
      for (std::size_t k = 0; k < indices.size(); ++k) {
        const int t = indices[k];
        const Reading& reading = data.readings[static_cast<std::size_t>(t)];
        Link& link = likelihood.links_[static_cast<std::size_t>(t)];
        double pivot = reading.sd;
        if (length > 0 && k > 0) {
          link.previous = indices[k - 1];
          const Reading& before = data.readings[static_cast<std::size_t>(link.previous)];
          const double distance = std::abs(reading.control - before.control) / length;
          const double left_open = -std::expm1(-2 * distance);  // of the variance: 1 - rho^2
          if (!(left_open > kLeastOpenShare)) return Singular(data, key, t);
          link.carried = std::exp(-distance) * reading.sd / before.sd;
          pivot *= std::sqrt(left_open);
        }
        link.inverse_pivot = 1 / pivot;
        likelihood.log_diagonal_[t] = std::log(pivot);
      }
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
      factor.log_constant[k] = -std::log(GammaRatio(before, 0.5));
    }
    likelihood.factors_.push_back(std::move(factor));
  }
  return likelihood;
}

void GaussianLikelihood::WhitenLink(const Rows& predictions, int t,
                                    Eigen::Ref<Eigen::ArrayXd> z) const {
  const Link& link = links_[static_cast<std::size_t>(t)];
  const double value = values_[static_cast<std::size_t>(t)];
  if (link.previous < 0) {
    z = (value - predictions.col(t).array()) * link.inverse_pivot;
    return;
  }
  const double before = values_[static_cast<std::size_t>(link.previous)];
  z = ((value - predictions.col(t).array()) -
       link.carried * (before - predictions.col(link.previous).array())) *
      link.inverse_pivot;
}

// Column by column: every operation is on one element of a column at a time, so that a row's bits
// do not depend on the other rows.
void GaussianLikelihood::Whiten(const Rows& predictions, Missing missing, MutableRows z_all) const {
  assert(predictions.cols() == readings_);
  const Eigen::Index n = predictions.rows();
  const bool complete = AllFinite(predictions);
  std::vector<char> reached(static_cast<std::size_t>(n));
  for (const Group& group : groups_) {
    std::fill(reached.begin(), reached.end(), 1);
    // What comes after a reading takes nothing from it where it was not reached.
    const auto close = [&](int t) {
      for (Eigen::Index i = 0; !complete && i < n; ++i) {
        char& row = reached[static_cast<std::size_t>(i)];
        row = static_cast<char>(row & static_cast<char>(std::isfinite(predictions(i, t))));
        if (row == 0) z_all(i, t) = 0;
      }
    };
    if (group.cholesky.size() == 0) {
      for (const int t : group.readings) {
        WhitenLink(predictions, t, z_all.col(t).array());
        close(t);
      }
    } else {
      SubstituteForward(group, predictions, z_all, close);
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

void GaussianLikelihood::SubstituteForward(const Group& group, const Rows& predictions,
                                           MutableRows z_all,
                                           absl::FunctionRef<void(int)> close) const {
  const Eigen::Index n = predictions.rows();
  const auto size = static_cast<Eigen::Index>(group.readings.size());
  std::vector<double*> z;
  std::vector<const double*> factors;
  for (Eigen::Index k = 0; k < size; ++k) {
    const int t = group.readings[static_cast<std::size_t>(k)];
    z_all.col(t) = values_[static_cast<std::size_t>(t)] - predictions.col(t).array();
    z.push_back(z_all.col(t).data());
    factors.push_back(group.cholesky.row(k).data());
  }
  for (Eigen::Index begin = 0; begin < size; begin += kRows) {
    const bool whole = begin + kRows <= size;
    if (whole) SubtractEarlierFromRows(&factors[begin], z.data(), begin, n, &z[begin]);
    const Eigen::Index taken = whole ? begin : 0;
    for (Eigen::Index k = begin; k < std::min(begin + kRows, size); ++k) {
      SubtractEarlier(factors[k] + taken, &z[taken], k - taken, n, z[k]);
      const int t = group.readings[static_cast<std::size_t>(k)];
      z_all.col(t) /= group.cholesky(k, k);
      close(t);
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
    const double constant = -kHalfLogTwoPi - log_diagonal_[t];
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
      auto column = increments.col(t).array();
      WhitenLink(predictions, t, column);
      column = (-kHalfLogTwoPi - log_diagonal_[t]) - 0.5 * column.square();
    }
    return increments;
  }
  constexpr Eigen::Index kBlock = 64;  // rows whose columns stay in the cache, close together
  Eigen::MatrixXd scratch(std::min(kBlock, predictions.rows()), readings_);
  for (Eigen::Index first = 0; first < predictions.rows(); first += kBlock) {
    const Eigen::Index size = std::min(kBlock, predictions.rows() - first);
    MutableRows block = scratch.topRows(size);
    if (!levels_.empty()) block.setZero();
    Whiten(predictions.middleRows(first, size), missing, block);
    for (const FactorGroup& group : factors_) IntegrateFactor(group, block);
    MutableRows to = increments.middleRows(first, size);
    if (inferred_) {
      to = block;
      continue;
    }
    for (int t = 0; t < readings_; ++t) {
      to.col(t).array() = (-kHalfLogTwoPi - log_diagonal_[t]) - 0.5 * block.col(t).array().square();
    }
    for (const LevelGroup& group : levels_) {
      IntegrateLevels(group, predictions.middleRows(first, size), missing, to);
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
