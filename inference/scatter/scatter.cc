#include "inference/scatter/scatter.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

namespace calib::inference {
namespace {

using Eigen::Index;

// The grid of the likelihood; chosen: finer steps move no sd by what few packings know of it.
constexpr int kLengths = 100;
constexpr double kShortest = 0.1;  // length over the closest readings' distance
constexpr double kLongest = 100;   // length over the whole path
constexpr double kClosest = 1e-6;  // closest distance over the whole path, where readings coincide
constexpr std::array kAtStart{1e-4, 1e-3, 1e-2, 1e-1, 1.0};  // share of the final variance
constexpr std::array kPowers{1, 2, 3};
// Readings that scatter by less than this part of the largest sd, as at the start itself, count as
// if they scattered by so much; chosen: they would otherwise be all of the likelihood.
constexpr double kNegligible = 1e-3;
constexpr double kLeastOpen = 1e-9;  // of a reading's variance beside its neighbour's; chosen

// The shape of a process that starts with the part `at_start` of its final variance.
struct Shape {
  Eigen::VectorXd variance;  // up to the stages' scales
  Eigen::VectorXd clock;
};

Shape ShapeOf(const Eigen::VectorXd& control, double length, double at_start, int power) {
  const Eigen::ArrayXd open = 1 - (1 - at_start) * (-2 / length * control.array()).exp();
  return {.variance = open.pow(power), .clock = control.array() / length + 0.5 * open.log()};
}

// Variances of unit `unit` scaled to the moments, stage by stage.
Eigen::VectorXd ScaledToStages(const Eigen::VectorXd& unit, const ScatterMoments& moments,
                               const std::vector<int>& stage) {
  std::map<int, std::pair<double, int>> sums;
  for (Index i = 0; i < unit.size(); ++i) {
    auto& [sum, count] = sums[stage[static_cast<std::size_t>(i)]];
    sum += moments.variance[i] / unit[i];
    ++count;
  }
  Eigen::VectorXd variance(unit.size());
  for (Index i = 0; i < unit.size(); ++i) {
    const auto& [sum, count] = sums[stage[static_cast<std::size_t>(i)]];
    variance[i] = std::max(0.0, unit[i] * sum / count);
  }
  return variance;
}

// Expected log likelihood of the chain.
double MarkovLikelihood(const ScatterMoments& moments, const Eigen::VectorXd& variance,
                        const Eigen::VectorXd& clock) {
  double sum = -0.5 * (std::log(variance[0]) + moments.variance[0] / variance[0]);
  for (Index i = 0; i + 1 < variance.size(); ++i) {
    const double rho = std::exp(clock[i] - clock[i + 1]);
    const double open = std::max(kLeastOpen, 1 - rho * rho);
    const double here = moments.variance[i] / variance[i];
    const double next = moments.variance[i + 1] / variance[i + 1];
    const double both = moments.neighbour[i] / std::sqrt(variance[i] * variance[i + 1]);
    const double square = next - 2 * rho * both + rho * rho * here;
    sum -= 0.5 * (std::log(variance[i + 1]) + std::log(open) + square / open);
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

bool HaveParted(const Eigen::MatrixXd& runs, const Eigen::VectorXd& number,
                const Eigen::VectorXd& noise) {
  assert(runs.rows() >= 2 && number.size() == runs.rows() && noise.size() == runs.cols());
  Eigen::MatrixXd left = runs.rowwise() - runs.colwise().mean();
  double freedom = static_cast<double>(runs.rows()) - 1;
  if (runs.rows() > 2) {
    const Eigen::VectorXd along = (number.array() - number.mean()).matrix().normalized();
    left -= along * (along.transpose() * left).eval();
    --freedom;
  }
  const Eigen::RowVectorXd sd = (left.colwise().squaredNorm() / freedom).cwiseSqrt();
  return (sd.transpose().array() >= kParted * noise.array()).any();
}

GroupScatter FitScatter(const ScatterMoments& moments, const std::vector<int>& stage,
                        const Eigen::VectorXd& control) {
  const Index n = moments.variance.size();
  GroupScatter scatter;
  scatter.sd = ScaledToStages(Eigen::VectorXd::Ones(n), moments, stage).cwiseSqrt();
  scatter.clock = kFarApart * Eigen::VectorXd::LinSpaced(n, 0, static_cast<double>(n - 1));
  if (n < 3 || !(scatter.sd.maxCoeff() > 0)) return scatter;
  const double whole = control[n - 1] - control[0];
  if (!(whole > 0)) return scatter;
  ScatterMoments floored = moments;
  floored.variance =
      moments.variance.cwiseMax(kNegligible * kNegligible * moments.variance.maxCoeff());
  const Eigen::VectorXd distance = control.tail(n - 1) - control.head(n - 1);
  const double shortest = kShortest * std::max(distance.minCoeff(), kClosest * whole);
  const double ratio = std::log(kLongest * whole / shortest) / (kLengths - 1);
  double best = -std::numeric_limits<double>::infinity();
  for (int k = 0; k < kLengths; ++k) {
    const double length = shortest * std::exp(ratio * k);
    for (const double at_start : kAtStart) {
      for (const int power : kPowers) {
        if (at_start == 1 && power > 1) continue;  // stationary whatever the power
        const Shape shape = ShapeOf(control, length, at_start, power);
        const Eigen::VectorXd variance = ScaledToStages(shape.variance, floored, stage);
        const double value = MarkovLikelihood(floored, variance, shape.clock);
        if (value > best) {
          best = value;
          scatter.sd = variance.cwiseSqrt();
          scatter.clock = shape.clock;
          scatter.length = length;
        }
      }
    }
  }
  return scatter;
}

Eigen::MatrixXd ScatterCovariance(const GroupScatter& scatter) {
  const Index n = scatter.sd.size();
  Eigen::MatrixXd covariance = scatter.sd.cwiseAbs2().asDiagonal();
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < i; ++j) {
      covariance(i, j) = covariance(j, i) =
          scatter.sd[i] * scatter.sd[j] * std::exp(scatter.clock[j] - scatter.clock[i]);
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
    for (Index i = 0; i < n; ++i) sd[i] = data.readings[members[i]].sd;
    Eigen::MatrixXd total =
        sd.asDiagonal() * ErrorCorrelation(data, key, members) * sd.asDiagonal();
    total += (runs + one.share) * ScatterCovariance(one);
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
