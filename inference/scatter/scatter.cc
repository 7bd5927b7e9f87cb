#include "inference/scatter/scatter.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr int kLengths = 200;

Eigen::VectorXd StageDeviations(const ScatterMoments& moments, const std::vector<int>& stage) {
  std::map<int, std::pair<double, int>> sums;
  for (Index i = 0; i < moments.variance.size(); ++i) {
    auto& [sum, count] = sums[stage[static_cast<std::size_t>(i)]];
    sum += moments.variance[i];
    ++count;
  }
  Eigen::VectorXd sd(moments.variance.size());
  for (Index i = 0; i < sd.size(); ++i) {
    const auto& [sum, count] = sums[stage[static_cast<std::size_t>(i)]];
    sd[i] = std::sqrt(std::max(0.0, sum / count));
  }
  return sd;
}

// Expected log likelihood of u_1 ... u_n, u_i+1 | u_i ~ N(rho u_i, 1 - rho^2), given their moments.
double MarkovLikelihood(const ScatterMoments& scaled, const Eigen::VectorXd& distance,
                        double length) {
  double sum = 0;
  for (Index i = 0; i < distance.size(); ++i) {
    const double rho = std::exp(-distance[i] / length);
    const double open = -std::expm1(-2 * distance[i] / length);  // 1 - rho^2
    const double square =
        scaled.variance[i + 1] - 2 * rho * scaled.neighbour[i] + rho * rho * scaled.variance[i];
    sum -= 0.5 * (std::log(open) + square / open);
  }
  return sum;
}

}  // namespace

ScatterMoments MomentsOfReplicates(const Eigen::MatrixXd& runs) {
  assert(runs.rows() >= 2);
  const Index n = runs.cols();
  const Eigen::MatrixXd departure = runs.rowwise() - runs.colwise().mean();
  const auto freedom = static_cast<double>(runs.rows() - 1);
  ScatterMoments moments{.variance = departure.colwise().squaredNorm().transpose() / freedom,
                         .neighbour = Eigen::VectorXd::Zero(std::max<Index>(0, n - 1))};
  for (Index i = 0; i + 1 < n; ++i) {
    moments.neighbour[i] = departure.col(i).dot(departure.col(i + 1)) / freedom;
  }
  return moments;
}

GroupScatter FitScatter(const ScatterMoments& moments, const std::vector<int>& stage,
                        const Eigen::VectorXd& control) {
  const Index n = moments.variance.size();
  GroupScatter scatter;
  scatter.sd = StageDeviations(moments, stage);
  if (n < 3 || !(scatter.sd.minCoeff() > 0)) return scatter;
  const double whole = control[n - 1] - control[0];
  if (!(whole > 0)) return scatter;
  Eigen::VectorXd distance = control.tail(n - 1) - control.head(n - 1);
  distance = distance.cwiseMax(1e-6 * whole);
  ScatterMoments scaled = moments;
  scaled.variance.array() /= scatter.sd.array().square();
  scaled.neighbour.array() /= scatter.sd.head(n - 1).array() * scatter.sd.tail(n - 1).array();
  const double first = 0.1 * distance.minCoeff();
  const double ratio = std::log(100 * whole / first) / (kLengths - 1);
  double best = -std::numeric_limits<double>::infinity();
  for (int k = 0; k < kLengths; ++k) {
    const double length = first * std::exp(ratio * k);
    const double value = MarkovLikelihood(scaled, distance, length);
    if (value > best) {
      best = value;
      scatter.length = k == 0 ? 0 : length;
    }
  }
  return scatter;
}

Eigen::MatrixXd ScatterCovariance(const GroupScatter& scatter, const Eigen::VectorXd& control) {
  const Index n = scatter.sd.size();
  Eigen::MatrixXd covariance = scatter.sd.cwiseAbs2().asDiagonal();
  for (Index i = 0; scatter.length > 0 && i < n; ++i) {
    for (Index j = 0; j < i; ++j) {
      covariance(i, j) = covariance(j, i) =
          scatter.sd[i] * scatter.sd[j] *
          std::exp(-std::abs(control[i] - control[j]) / scatter.length);
    }
  }
  return covariance;
}

DataSet WithScatter(const DataSet& data, const std::vector<GroupScatter>& scatter, double runs) {
  const ReadingGroups groups = GroupsOf(data);
  DataSet result = data;
  for (const GroupScatter& one : scatter) {
    const std::pair<int, int> key{one.experiment, one.observable};
    const auto group = groups.find(key);
    if (group == groups.end()) continue;
    const std::vector<int>& members = group->second;
    const auto n = static_cast<Index>(members.size());
    assert(one.sd.size() == n);
    Eigen::VectorXd sd(n);
    Eigen::VectorXd control(n);
    for (Index i = 0; i < n; ++i) {
      sd[i] = data.readings[members[i]].sd;
      control[i] = data.readings[members[i]].control;
    }
    Eigen::MatrixXd total =
        sd.asDiagonal() * ErrorCorrelation(data, key, members) * sd.asDiagonal();
    total += (runs + one.share) * ScatterCovariance(one, control);
    for (Index i = 0; i < n; ++i) result.readings[members[i]].sd = std::sqrt(total(i, i));
    const auto is_same = [&key](const auto& entry) {
      return std::pair(entry.experiment, entry.observable) == key;
    };
    std::erase_if(result.correlations, is_same);
    std::erase_if(result.covariances, is_same);
    result.covariances.push_back(
        {.experiment = key.first, .observable = key.second, .matrix = std::move(total)});
  }
  return result;
}

}  // namespace calib::inference
