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

// The noise group of each reading; no entries without groups.
std::vector<Index> GroupOfReadings(const std::vector<NoiseGroup>& groups, const DataSet& data) {
  std::map<std::pair<int, int>, Index> of_curve;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    for (const auto& member : groups[g].members) of_curve[member] = static_cast<Index>(g);
  }
  std::vector<Index> group;
  if (groups.empty()) return group;
  for (const Reading& reading : data.readings) {
    group.push_back(of_curve.at({reading.experiment, reading.observable}));
  }
  return group;
}

Eigen::MatrixXd SquaresOfGroups(const PrincipalComponents& components,
                                const std::vector<Index>& group) {
  const Index groups = group.empty() ? 1 : *std::max_element(group.begin(), group.end()) + 1;
  Eigen::MatrixXd shares = Eigen::MatrixXd::Zero(groups, components.basis.cols());
  for (Index k = 0; k < components.basis.rows(); ++k) {
    const Index g = group.empty() ? 0 : group[static_cast<std::size_t>(k)];
    shares.row(g) += components.basis.row(k).cwiseAbs2();
  }
  return shares;
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
  group_ = GroupOfReadings(groups_, data);
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

Eigen::MatrixXd EmulatedTarget::Factors(const Eigen::MatrixXd& points) const {
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
                                        const Eigen::MatrixXd& factors) const {
  const Eigen::MatrixXd by_group = sd.cwiseAbs2() * shares_.transpose();
  return factors.cols() == 0 ? Eigen::VectorXd(by_group.rowwise().sum())
                             : Eigen::VectorXd(by_group.cwiseQuotient(factors).rowwise().sum());
}

EmulatedPoints EmulatedTarget::At(const Eigen::MatrixXd& points) const {
  EmulatedPoints at;
  at.prediction = Predict(Complete(points));
  at.factors = Factors(points);
  at.unknown = Unknown(at.prediction.sd, at.factors);
  return at;
}

}  // namespace calib::inference
