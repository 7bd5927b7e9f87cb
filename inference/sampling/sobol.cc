#include "inference/sampling/sobol.h"

#include <boost/random/sobol.hpp>
#include <cassert>
#include <vector>

#include "inference/sampling/philox.h"

namespace calib::inference {
namespace {

constexpr int kBits = 32;  // of a coordinate

// Nested uniform scramble of one coordinate. The prefix of b leading bits, with a one in front so
// that 0 and 00 differ, names the node of the binary tree whose two halves are or are not
// exchanged.
std::uint32_t Scramble(std::uint32_t x, std::uint64_t seed, int dimension) {
  std::uint32_t flips = 0;
  for (int b = 0; b < kBits; ++b) {
    const std::uint64_t node = (std::uint64_t{1} << b) | (b == 0 ? 0 : x >> (kBits - b));
    PhiloxStream stream({.seed = seed,
                         .purpose = StreamPurpose::kSobolScramble,
                         .iteration = static_cast<std::uint64_t>(dimension),
                         .sample = node});
    flips |= static_cast<std::uint32_t>(stream.Bits() & 1) << (kBits - 1 - b);
  }
  return x ^ flips;
}

}  // namespace

Eigen::MatrixXd ScrambledSobol(int n, int d, std::uint64_t seed) {
  assert(n >= 0 && d >= 1);
  boost::random::sobol_engine<std::uint32_t, kBits> engine(static_cast<std::size_t>(d));
  Eigen::MatrixXd points(n, d);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < d; ++j) {
      const std::uint32_t plain =
          i == 0 ? 0 : engine();  // Boost's sequence begins after the origin
      points(i, j) = (Scramble(plain, seed, j) + 0.5) * 0x1p-32;
    }
  }
  return points;
}

}  // namespace calib::inference
