#include "inference/scatter/shrunk_covariance.h"

#include <algorithm>
#include <cassert>
#include <map>

#include "inference/numerics/decompositions.h"

namespace calib::inference {

using Eigen::Index;

ShrunkCovariance ShrinkCovariance(const Eigen::MatrixXd& departures, const std::vector<int>& group,
                                  const Eigen::MatrixXd& target, const Eigen::MatrixXd& unit) {
  const Index n = departures.rows();
  assert(static_cast<Index>(group.size()) == n);
  std::map<int, std::vector<Index>> groups;
  for (Index i = 0; i < n; ++i) groups[group[static_cast<std::size_t>(i)]].push_back(i);
  if (groups.size() < 2) return {.covariance = target, .target_weight = 1};
  const Eigen::LLT<Eigen::MatrixXd> factor(unit);
  const Eigen::MatrixXd z = LowerSolved(factor, departures.transpose());  // T x n
  const auto count = static_cast<double>(n);
  const Eigen::MatrixXd seen = z * z.transpose() / count;
  const Eigen::MatrixXd closed = LowerSolved(factor, LowerSolved(factor, target).transpose());
  double chance = 0;
  for (const auto& [number, rows] : groups) {
    const Eigen::MatrixXd own = z(Eigen::all, rows);
    chance += (own * own.transpose() - static_cast<double>(rows.size()) * seen).squaredNorm();
  }
  const auto witnesses = static_cast<double>(groups.size());
  chance *= witnesses / (witnesses - 1) / (count * count);
  const double distance = (seen - closed).squaredNorm();
  const double weight = distance > chance ? chance / distance : 1;
  return {
      .covariance = (1 - weight) / count * departures.transpose() * departures + weight * target,
      .target_weight = weight};
}

}  // namespace calib::inference
