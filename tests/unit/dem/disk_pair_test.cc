// Elongated grains of a plane: area and moment of two disks taken together.
#include "dem/particles/disk_pair.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace calib::dem {
namespace {

constexpr double kPi = std::numbers::pi;

/// By strips across the line of centres: s from the middle, half height h.
PlateMoments ByStrips(double radius, double offset) {
  PlateMoments sum;
  constexpr int kStrips = 400000;
  const double reach = radius + offset;
  const double width = 2 * reach / kStrips;
  for (int k = 0; k < kStrips; ++k) {
    const double s = -reach + (k + 0.5) * width;
    const double from = std::abs(s) - offset;
    const double h = std::sqrt(std::max(0.0, radius * radius - from * from));
    sum.area += 2 * h * width;
    sum.polar += (2 * h * s * s + 2 * h * h * h / 3) * width;
  }
  return sum;
}

TEST(DiskPair, OneDiskAndTwoThatTouch) {
  const PlateMoments one = MomentsOfDiskPair(2, 0);
  EXPECT_NEAR(one.area, 4 * kPi, 1e-14 * one.area);
  EXPECT_NEAR(one.polar, 8 * kPi, 1e-14 * one.polar);
  const PlateMoments two = MomentsOfDiskPair(2, 2);
  EXPECT_NEAR(two.area, 8 * kPi, 1e-14 * two.area);
  EXPECT_NEAR(two.polar, 2 * (8 * kPi + 4 * kPi * 4), 1e-14 * two.polar);
}

TEST(DiskPair, OverlapsCountOnce) {
  for (const double offset : {0.05, 0.3, 0.7, 0.95}) {
    const PlateMoments exact = MomentsOfDiskPair(1.3, 1.3 * offset);
    const PlateMoments strips = ByStrips(1.3, 1.3 * offset);
    EXPECT_NEAR(exact.area, strips.area, 1e-8 * strips.area) << offset;
    EXPECT_NEAR(exact.polar, strips.polar, 1e-8 * strips.polar) << offset;
  }
}

TEST(DiskPair, HasTheAreaOfTheDiskThatItReplaces) {
  for (const double aspect : {1.01, 1.4, 2.0}) {
    const ClumpTemplate shape = DiskPairTemplate(aspect);
    ASSERT_EQ(shape.spheres.size(), 2U);
    const Sphere& upper = shape.spheres[1];
    EXPECT_NEAR(MomentsOfDiskPair(upper.radius, upper.centre[2]).area, kPi, 1e-13) << aspect;
    EXPECT_NEAR(ReachOf(shape) / upper.radius, aspect, 1e-13);
    EXPECT_EQ(shape.spheres[0].centre[2], -upper.centre[2]);
    EXPECT_EQ(upper.centre[0], 0);
    EXPECT_EQ(upper.centre[1], 0);
  }
}

}  // namespace
}  // namespace calib::dem
