#include "inference/sampling/halton.h"

#include <algorithm>
#include <cassert>
#include <vector>

namespace calib::inference {
namespace {

std::vector<std::uint32_t> FirstPrimes(int count) {
  std::vector<std::uint32_t> primes;
  for (std::uint32_t candidate = 2; static_cast<int>(primes.size()) < count; ++candidate) {
    const bool composite = std::any_of(primes.begin(), primes.end(),
                                       [candidate](std::uint32_t p) { return candidate % p == 0; });
    if (!composite) primes.push_back(candidate);
  }
  return primes;
}

}  // namespace

double RadicalInverse(std::uint64_t index, std::uint32_t base) {
  assert(base >= 2);
  std::uint64_t mirrored = 0;
  std::uint64_t scale = 1;
  for (; index > 0; index /= base) {
    mirrored = mirrored * base + index % base;
    scale *= base;
  }
  return static_cast<double>(mirrored) / static_cast<double>(scale);
}

Eigen::MatrixXd Halton(int n, int d) {
  assert(n >= 0 && d >= 0);
  const std::vector<std::uint32_t> bases = FirstPrimes(d);
  Eigen::MatrixXd points(n, d);
  for (int j = 0; j < d; ++j) {
    for (int i = 0; i < n; ++i)
      points(i, j) = RadicalInverse(static_cast<std::uint64_t>(i) + 1, bases[j]);
  }
  return points;
}

}  // namespace calib::inference
