#include "server/scheduler/held_out.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace calib::scheduler {
namespace {

constexpr double kMass = 0.99;

}  // namespace

std::vector<std::size_t> Heaviest(const std::vector<double>& log_weights) {
  std::vector<std::size_t> order(log_weights.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&log_weights](std::size_t a, std::size_t b) {
    return log_weights[a] > log_weights[b];
  });
  std::size_t count = 0;
  double mass = 0;
  while (count < std::min(order.size(), kHeldOutRuns) && mass < kMass) {
    mass += std::exp(log_weights[order[count++]]);
  }
  order.resize(count);
  return order;
}

std::vector<std::size_t> EvenlyByWeight(const std::vector<double>& log_weights) {
  std::vector<std::size_t> positions;
  double mass = 0;
  double next = 0.5;
  for (std::size_t i = 0; i < log_weights.size(); ++i) {
    mass += std::exp(log_weights[i]) * static_cast<double>(kHeldOutRuns);
    if (mass <= next) continue;
    next = std::floor(mass - 0.5) + 1.5;
    positions.push_back(i);
  }
  return positions;
}

Eigen::MatrixXd EvenlySpaced(const Eigen::MatrixXd& draws, std::size_t most) {
  const auto count = static_cast<Eigen::Index>(
      std::min({kHeldOutRuns, most, static_cast<std::size_t>(draws.rows())}));
  Eigen::MatrixXd rows(count, draws.cols());
  for (Eigen::Index i = 0; i < count; ++i) rows.row(i) = draws.row(i * draws.rows() / count);
  return rows;
}

}  // namespace calib::scheduler
