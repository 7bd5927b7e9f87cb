#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "inference/sampling/halton.h"
#include "inference/sampling/philox.h"
#include "inference/sampling/shuffle.h"
#include "inference/sampling/sobol.h"

namespace calib::inference {
namespace {

TEST(Shuffled, EveryOrderAsOften) {
  int first_of[4] = {};
  constexpr int kDraws = 4000;
  for (std::uint64_t k = 0; k < kDraws; ++k) {
    const auto order =
        Shuffled(4, PhiloxStream({.seed = 1, .purpose = StreamPurpose::kTest, .sample = k}));
    ++first_of[order.front()];
    std::vector<Eigen::Index> sorted = order;
    std::sort(sorted.begin(), sorted.end());
    ASSERT_EQ(sorted, (std::vector<Eigen::Index>{0, 1, 2, 3}));
  }
  for (const int count : first_of)
    EXPECT_NEAR(count, kDraws / 4, 4 * std::sqrt(kDraws * 0.25 * 0.75));
  EXPECT_TRUE(Shuffled(0, PhiloxStream({})).empty());
}

TEST(Halves, OneOfEachPair) {
  const auto half = Halves(1001);
  int firsts = 0;
  for (std::size_t k = 0; k + 1 < half.size(); k += 2) {
    ASSERT_EQ(half[k] + half[k + 1], 1);
    firsts += half[k];
  }
  EXPECT_NEAR(firsts, 250, 4 * std::sqrt(500 * 0.25));
}

TEST(Halton, FirstPointsAreTheKnownFractions) {
  const Eigen::MatrixXd points = Halton(4, 3);
  const double expected[4][3] = {{1.0 / 2, 1.0 / 3, 1.0 / 5},
                                 {1.0 / 4, 2.0 / 3, 2.0 / 5},
                                 {3.0 / 4, 1.0 / 9, 3.0 / 5},
                                 {1.0 / 8, 4.0 / 9, 4.0 / 5}};
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 3; ++j) EXPECT_EQ(points(i, j), expected[i][j]) << i << ", " << j;
  }
}

TEST(Halton, BasesAreThePrimes) {
  const Eigen::MatrixXd points = Halton(1, 12);
  const double primes[] = {2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37};
  for (int j = 0; j < 12; ++j) EXPECT_EQ(points(0, j), 1 / primes[j]);
}

// Every one of 2^m intervals of every coordinate holds exactly one of 2^m points: the net property
// survives scrambling.
TEST(ScrambledSobol, EachCoordinateIsStratified) {
  constexpr int kN = 256;
  const Eigen::MatrixXd points = ScrambledSobol(kN, 25, 7);
  for (int j = 0; j < 25; ++j) {
    std::vector<int> hits(kN, 0);
    for (int i = 0; i < kN; ++i) ++hits[static_cast<int>(points(i, j) * kN)];
    EXPECT_EQ(std::count(hits.begin(), hits.end(), 1), kN) << "coordinate " << j;
  }
}

// The first two coordinates are a (0, 8, 2)-net: every elementary box of area 2^-8 holds one point.
TEST(ScrambledSobol, FirstTwoCoordinatesAreANet) {
  const Eigen::MatrixXd points = ScrambledSobol(256, 2, 3);
  for (int bits = 0; bits <= 8; ++bits) {
    const int rows = 1 << bits;
    const int columns = 256 / rows;
    std::vector<int> hits(256, 0);
    for (int i = 0; i < 256; ++i) {
      ++hits[static_cast<int>(points(i, 0) * rows) * columns +
             static_cast<int>(points(i, 1) * columns)];
    }
    EXPECT_EQ(std::count(hits.begin(), hits.end(), 1), 256) << rows << " x " << columns;
  }
}

TEST(ScrambledSobol, RowsDoNotDependOnTheNumberOfPointsButOnTheSeed) {
  const Eigen::MatrixXd few = ScrambledSobol(10, 4, 1);
  const Eigen::MatrixXd many = ScrambledSobol(100, 4, 1);
  EXPECT_EQ(few, many.topRows(10));
  EXPECT_NE(few, ScrambledSobol(10, 4, 2));
}

TEST(Philox, StreamIsAFunctionOfKeyAndDrawAlone) {
  PhiloxStream one({.seed = 5, .purpose = StreamPurpose::kTest, .iteration = 1, .sample = 2});
  PhiloxStream same({.seed = 5, .purpose = StreamPurpose::kTest, .iteration = 1, .sample = 2});
  PhiloxStream other({.seed = 5, .purpose = StreamPurpose::kTest, .iteration = 1, .sample = 3});
  int differences = 0;
  for (int k = 0; k < 10; ++k) {
    const auto bits = one.Bits();
    EXPECT_EQ(bits, same.Bits());
    differences += bits != other.Bits();
  }
  EXPECT_EQ(differences, 10);
}

// Known-answer vector of Philox4x64-10 for zero key and counter [Random123, kat_vectors].
TEST(Philox, ZeroSeedBlockIsTheBitsOfItsKey) {
  PhiloxStream stream({.seed = 0, .purpose = StreamPurpose{0}, .iteration = 0, .sample = 0});
  EXPECT_EQ(stream.Bits(), 0x16554d9eca36314cULL);
  EXPECT_EQ(stream.Bits(), 0xdb20fe9d672d0fdcULL);
  EXPECT_EQ(stream.Bits(), 0xd7e772cee186176bULL);
  EXPECT_EQ(stream.Bits(), 0x7e68b68aec7ba23bULL);
}

TEST(Philox, NormalHasUnitMoments) {
  PhiloxStream stream({.seed = 1});
  double sum = 0;
  double squares = 0;
  double fourth = 0;
  constexpr int kN = 200000;
  for (int i = 0; i < kN; ++i) {
    const double z = stream.Normal();
    sum += z;
    squares += z * z;
    fourth += z * z * z * z;
  }
  EXPECT_NEAR(sum / kN, 0, 5 / std::sqrt(kN));
  EXPECT_NEAR(squares / kN, 1, 5 * std::sqrt(2.0 / kN));
  EXPECT_NEAR(fourth / kN, 3, 5 * std::sqrt(96.0 / kN));
}

}  // namespace
}  // namespace calib::inference
