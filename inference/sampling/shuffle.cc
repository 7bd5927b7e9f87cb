#include "inference/sampling/shuffle.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace calib::inference {

using Eigen::Index;

std::vector<Index> Shuffled(Index n, PhiloxStream stream) {
  std::vector<Index> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), 0);
  for (std::size_t left = order.size(); left > 1; --left) {
    const auto of_left = static_cast<std::size_t>(stream.Uniform() * static_cast<double>(left));
    std::swap(order[left - 1], order[std::min(of_left, left - 1)]);
  }
  return order;
}

std::vector<int> Halves(Index n) {
  std::vector<int> half(static_cast<std::size_t>(n));
  PhiloxStream stream({.seed = 0, .purpose = StreamPurpose::kHalves, .iteration = 0, .sample = 0});
  for (std::size_t row = 0; row < half.size(); row += 2) {
    half[row] = stream.Uniform() < 0.5 ? 0 : 1;
    if (row + 1 < half.size()) half[row + 1] = 1 - half[row];
  }
  return half;
}

}  // namespace calib::inference
