// Grains of a shape thrown into a region.
#include "dem/particles/loose_fill.h"

#include <gtest/gtest.h>

#include <cmath>

#include "dem/particles/disk_pair.h"

namespace calib::dem {
namespace {

constexpr double kWidth = 10;
constexpr double kDepth = 6;

FillRegion Tube(double height) {
  return {.low = {1, 2, 3},
          .width = kWidth,
          .depth = kDepth,
          .height = height,
          .holds = [](const Vec3& c,
                      double r) { return std::abs(c.x - 1 - kWidth / 2) + r < kWidth / 2; },
          .repeats = true};
}

std::vector<double> Radii(int grains) {
  std::vector<double> radii;
  radii.reserve(static_cast<std::size_t>(grains));
  for (int k = 0; k < grains; ++k) {
    radii.push_back(0.4 + 0.2 * k / grains);
  }
  return radii;
}

/// Largest overlap of two grains, images across y among them [m].
double LargestOverlap(const Packing& p) {
  double largest = -1;
  for (std::size_t i = 0; i < p.x.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (p.clump[i] == p.clump[j]) {
        continue;
      }
      const double dy = std::remainder(p.y[i] - p.y[j], kDepth);
      const double dx = p.x[i] - p.x[j];
      const double dz = p.z[i] - p.z[j];
      largest =
          std::max(largest, p.radius[i] + p.radius[j] - std::sqrt(dx * dx + dy * dy + dz * dz));
    }
  }
  return largest;
}

TEST(RandomFill, GrainsStandInTheRegionAndTouchNoOther) {
  const ClumpTemplate shape = DumbbellTemplate(1.7);
  for (const double height : {0.0, 20.0}) {
    const FillRegion tube = Tube(height);
    const Packing p = RandomFill(Radii(300), shape, tube, 4);
    ASSERT_EQ(p.x.size(), 600U) << height;
    EXPECT_LT(LargestOverlap(p), 0) << height;
    for (std::size_t i = 0; i < p.x.size(); ++i) {
      EXPECT_EQ(p.clump[i], static_cast<int>(i / 2));
      EXPECT_TRUE(tube.holds({p.x[i], p.y[i], p.z[i]}, p.radius[i]));
      EXPECT_GE(p.z[i] - p.radius[i], 3);
      if (height > 0) {
        EXPECT_LE(p.z[i] + p.radius[i], 3 + height);
      }
    }
  }
}

TEST(RandomFill, DirectionsAreUniform) {
  const Packing p = RandomFill(Radii(300), DumbbellTemplate(1.7), Tube(0), 4);
  double square[3] = {0, 0, 0};  // of the axis' components: 1/3 each, sd of the mean 0.017
  for (std::size_t i = 0; i < p.x.size(); i += 2) {
    const double d[3] = {p.x[i] - p.x[i + 1], p.y[i] - p.y[i + 1], p.z[i] - p.z[i + 1]};
    const double length2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    for (int a = 0; a < 3; ++a) {
      square[a] += d[a] * d[a] / length2 / 300;
    }
  }
  for (const double s : square) {
    EXPECT_NEAR(s, 1.0 / 3, 0.07);  // walls keep some directions away
  }
}

TEST(RandomFill, InAPlaneGrainsLieInItAndTurnInIt) {
  FillRegion plane = Tube(0);
  plane.depth = 0;
  plane.repeats = false;
  const Packing p = RandomFill(Radii(400), DiskPairTemplate(1.6), plane, 4);
  ASSERT_EQ(p.x.size(), 800U);
  double cos2 = 0;
  double sin2 = 0;
  for (std::size_t i = 0; i < p.x.size(); ++i) {
    EXPECT_EQ(p.y[i], plane.low.y);
    EXPECT_TRUE(plane.holds({p.x[i], p.y[i], p.z[i]}, p.radius[i]));
    EXPECT_GE(p.z[i] - p.radius[i], plane.low.z);
    if (i % 2 == 0) {
      const double angle = std::atan2(p.z[i + 1] - p.z[i], p.x[i + 1] - p.x[i]);
      cos2 += std::cos(2 * angle) / 400;
      sin2 += std::sin(2 * angle) / 400;
    }
  }
  EXPECT_LT(LargestOverlap(p), 0);
  EXPECT_LT(std::hypot(cos2, sin2), 0.12);  // chance: 0.05 the mean, 0.12 in 0.3 %
}

TEST(RandomFill, SameSeedSameBitsAndAFullRegionSaysSo) {
  const ClumpTemplate shape = DumbbellTemplate(1.3);
  const Packing one = RandomFill(Radii(100), shape, Tube(0), 9);
  const Packing two = RandomFill(Radii(100), shape, Tube(0), 9);
  const Packing other = RandomFill(Radii(100), shape, Tube(0), 10);
  EXPECT_EQ(one.x, two.x);
  EXPECT_NE(one.x, other.x);
  const Packing full = RandomFill(Radii(1000), shape, Tube(3), 9);
  EXPECT_GT(full.x.size(), 100U);
  EXPECT_LT(full.x.size(), 2000U);
  FillRegion none = Tube(0);  // of unlimited height, but too narrow
  none.holds = [](const Vec3&, double) { return false; };
  EXPECT_TRUE(RandomFill(Radii(3), shape, none, 9).x.empty());
}

}  // namespace
}  // namespace calib::dem
