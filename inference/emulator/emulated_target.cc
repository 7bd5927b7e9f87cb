#include "inference/emulator/emulated_target.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "inference/numerics/special_functions.h"
#include "inference/numerics/standard_normal.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// Ends of z, in its standard deviations, beyond which its distribution function is 0 or 1 in
// double.
constexpr double kFarthest = 8;
constexpr double kLeastSquare = 1e-12;  // of z, where its inverse would leave all scales; chosen

// An inverse gamma of shape and rate 1/2 is the law of 1 / z^2, z standard normal.
bool IsDefault(const VarianceFactorPrior& prior) { return prior.shape == 0.5 && prior.rate == 0.5; }

// The group of each reading, -1 where it has none; no entries without groups.
template <typename Group>
std::vector<Index> GroupOfReadings(const std::vector<Group>& groups, const DataSet& data) {
  std::map<std::pair<int, int>, Index> of_curve;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    for (const auto& member : groups[g].members) of_curve[member] = static_cast<Index>(g);
  }
  std::vector<Index> group;
  if (groups.empty()) return group;
  for (const Reading& reading : data.readings) {
    const auto found = of_curve.find({reading.experiment, reading.observable});
    group.push_back(found == of_curve.end() ? -1 : found->second);
  }
  return group;
}

// Rows of the groups; one more where there are readings of none, or no groups.
Eigen::MatrixXd SquaresOfGroups(const PrincipalComponents& components,
                                const std::vector<Index>& group) {
  const Index groups = group.empty() ? 0 : *std::max_element(group.begin(), group.end()) + 1;
  const bool others =
      group.empty() || std::find(group.begin(), group.end(), Index{-1}) != group.end();
  Eigen::MatrixXd shares =
      Eigen::MatrixXd::Zero(groups + (others ? 1 : 0), components.basis.cols());
  for (Index k = 0; k < components.basis.rows(); ++k) {
    const Index g = group.empty() ? 0 : group[static_cast<std::size_t>(k)];
    shares.row(g < 0 ? groups : g) += components.basis.row(k).cwiseAbs2();
  }
  return shares;
}

// Prior probability up to the end of each level; the last is one.
std::vector<double> Cumulated(const ErrorCells& cells) {
  std::vector<double> below;
  double sum = 0;
  for (const double log_mass : cells.LogMass()) below.push_back(sum += std::exp(log_mass));
  for (double& value : below) value /= sum;
  return below;
}

}  // namespace

Eigen::MatrixXd ToStandard(const JointPrior& priors, const Eigen::MatrixXd& parameters) {
  Eigen::MatrixXd result(parameters.rows(), static_cast<Index>(priors.size()));
  for (Index j = 0; j < result.cols(); ++j) {
    const Prior& prior = priors[static_cast<std::size_t>(j)];
    for (Index i = 0; i < result.rows(); ++i) result(i, j) = prior.ToStandard(parameters(i, j));
  }
  return result;
}

EmulatedTarget::EmulatedTarget(const JointPrior& priors, const DataSet& data, NoiseMode noise,
                               double max_error, const StateEmulator& emulator,
                               std::span<const Iteration> iterations)
    : priors_(priors),
      emulator_(emulator),
      held_(Eigen::RowVectorXd::Zero(static_cast<Index>(priors.size()))),
      most_unknown_(max_error * max_error * static_cast<double>(data.readings.size())) {
  const auto& frozen =
      iterations.empty() ? std::vector<std::optional<double>>{} : iterations.back().proposal.frozen;
  for (std::size_t j = 0; j < priors.size(); ++j) {
    const auto column = static_cast<Index>(j);
    if (frozen.empty() || !frozen[j]) {
      free_.push_back(column);
    } else {
      held_[column] = *frozen[j];
    }
  }
  prior_ = AnyHeld() ? priors.Of(free_) : priors;
  if (noise == NoiseMode::kInferred) {
    groups_ = NoiseGroupsOf(data);
    std::vector<Prior> scales;
    for (const NoiseGroup& group : groups_) {
      Prior& z = scales.emplace_back(Prior{.kind = PriorKind::kNormal, .mean = 0, .sd = 1});
      if (IsDefault(group.prior)) z.min = 0;
    }
    prior_ = prior_.With(scales);
  }
  if (noise == NoiseMode::kModelError) {
    for (const ModelError& error : data.model_errors) {
      cells_.push_back(CellsOf(error, data));
      below_.push_back(Cumulated(cells_.back()));
    }
    prior_ = prior_.With(
        std::vector<Prior>(cells_.size(), Prior{.kind = PriorKind::kUniform, .min = 0, .max = 1}));
    for (const Reading& reading : data.readings) {
      values_.push_back(reading.value);
      sds_.push_back(reading.sd);
    }
    group_ = GroupOfReadings(data.model_errors, data);
    AddSharesAtLevels(emulator.components());
  } else {
    group_ = GroupOfReadings(groups_, data);
  }
  shares_ = SquaresOfGroups(emulator.components(), group_);
}

std::optional<double> EmulatedTarget::Held(Index j) const {
  if (std::find(free_.begin(), free_.end(), j) != free_.end()) return std::nullopt;
  return held_[j];
}

Eigen::MatrixXd EmulatedTarget::Complete(const Eigen::MatrixXd& points) const {
  if (!AnyHeld()) return points.leftCols(held_.size());
  Eigen::MatrixXd all = held_.replicate(points.rows(), 1);
  for (std::size_t k = 0; k < free_.size(); ++k) {
    all.col(free_[k]) = points.col(static_cast<Index>(k));
  }
  return all;
}

ScorePrediction EmulatedTarget::Predict(const Eigen::MatrixXd& parameters) const {
  return emulator_.Predict(ToStandard(priors_, parameters));
}

void EmulatedTarget::AddSharesAtLevels(const PrincipalComponents& components) {
  for (const ErrorCells& cells : cells_) {
    shares_at_level_.push_back(Eigen::MatrixXd::Zero(cells.levels(), components.basis.cols()));
  }
  for (std::size_t t = 0; t < group_.size(); ++t) {
    if (group_[t] < 0) continue;
    Eigen::MatrixXd& shares = shares_at_level_[static_cast<std::size_t>(group_[t])];
    for (Index k = 0; k < shares.rows(); ++k) {
      shares.row(k) +=
          components.basis.row(static_cast<Index>(t)).cwiseAbs2() / LargerVariance(t, k);
    }
  }
}

double EmulatedTarget::LargerVariance(std::size_t reading, Index level) const {
  const ErrorCells& cells = cells_[static_cast<std::size_t>(group_[reading])];
  const double larger = RaisedError(cells, level, values_[reading], sds_[reading]) / sds_[reading];
  return larger * larger;
}

Eigen::VectorXd EmulatedTarget::LargerVariances(const Eigen::RowVectorXd& noise) const {
  Eigen::VectorXd variances = Eigen::VectorXd::Ones(emulator_.components().basis.rows());
  for (std::size_t t = 0; noise.size() > 0 && t < group_.size(); ++t) {
    if (group_[t] < 0) continue;
    const double value = noise[group_[t]];
    variances[static_cast<Index>(t)] =
        cells_.empty() ? value : LargerVariance(t, static_cast<Index>(value));
  }
  return variances;
}

Eigen::MatrixXd EmulatedTarget::Noise(const Eigen::MatrixXd& points) const {
  if (!cells_.empty()) {
    Eigen::MatrixXd levels = points.rightCols(static_cast<Index>(cells_.size()));
    for (Index g = 0; g < levels.cols(); ++g) {
      const std::vector<double>& below = below_[static_cast<std::size_t>(g)];
      for (double& u : levels.col(g)) {
        const auto above = std::upper_bound(below.begin(), below.end() - 1, u);
        u = static_cast<double>(above - below.begin());
      }
    }
    return levels;
  }
  Eigen::MatrixXd factors = points.rightCols(static_cast<Index>(groups_.size()));
  for (Index g = 0; g < factors.cols(); ++g) {
    const VarianceFactorPrior& prior = groups_[static_cast<std::size_t>(g)].prior;
    for (Index i = 0; i < factors.rows(); ++i) {
      double& z = factors(i, g);
      const double u =
          IsDefault(prior) ? 0 : std::exp(LogNormalCdf(std::clamp(z, -kFarthest, kFarthest)));
      z = IsDefault(prior) ? 1 / std::max(z * z, kLeastSquare)
                           : prior.rate / GammaQInverse(prior.shape, u);
    }
  }
  return factors;
}

Eigen::VectorXd EmulatedTarget::Unknown(const Eigen::MatrixXd& sd,
                                        const Eigen::MatrixXd& noise) const {
  const Eigen::MatrixXd by_group = sd.cwiseAbs2() * shares_.transpose();
  if (noise.cols() == 0) return by_group.rowwise().sum();
  if (cells_.empty()) return by_group.cwiseQuotient(noise).rowwise().sum();
  Eigen::VectorXd unknown =
      by_group.rightCols(by_group.cols() - noise.cols()).rowwise().sum();  // of no model error
  for (Index g = 0; g < noise.cols(); ++g) {
    const Eigen::MatrixXd& shares = shares_at_level_[static_cast<std::size_t>(g)];
    for (Index i = 0; i < unknown.size(); ++i) {
      unknown[i] += sd.row(i).cwiseAbs2().dot(shares.row(static_cast<Index>(noise(i, g))));
    }
  }
  return unknown;
}

EmulatedPoints EmulatedTarget::At(const Eigen::MatrixXd& points) const {
  EmulatedPoints at;
  at.prediction = Predict(Complete(points));
  at.noise = Noise(points);
  at.unknown = Unknown(at.prediction.sd, at.noise);
  return at;
}

}  // namespace calib::inference
