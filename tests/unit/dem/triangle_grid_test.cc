// Triangles near a point: none missed, few too many, in order.
#include "dem/geometry/triangle_grid.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace calib::dem {
namespace {

TriangleMesh Hopper() {
  TriangleMesh mesh;
  AddFrustum({.centre = {0.3, -0.2, 0}, .height = 0.5, .lower_radius = 0.1, .upper_radius = 0.4},
             mesh);
  AddFrustum({.centre = {0.3, -0.2, 0.5}, .height = 1, .lower_radius = 0.4, .upper_radius = 0.4},
             mesh);
  return mesh;
}

double DistanceTo(const TriangleMesh& mesh, int t, const Vec3& p) {
  const auto& corner = mesh.triangle[static_cast<std::size_t>(t)];
  const auto at = [&](std::size_t c) { return mesh.vertex[static_cast<std::size_t>(corner[c])]; };
  return Length(NearestPoint(p, at(0), at(1), at(2)) - p);
}

TEST(TriangleGrid, MissesNoTriangleAndKeepsTheirOrder) {
  constexpr double kRange = 0.03;
  const TriangleMesh mesh = Hopper();
  const TriangleGrid grid(mesh, kRange);
  std::mt19937 engine(3);
  std::uniform_real_distribution<double> place(-0.3, 1.7);
  std::uniform_real_distribution<double> distance(0.1 * kRange, kRange);
  std::vector<int> near;
  int found = 0;
  int given = 0;
  for (int k = 0; k < 20'000; ++k) {
    const Vec3 p{place(engine), place(engine), place(engine)};
    const double within = distance(engine);
    grid.Near(p, within, near);
    ASSERT_TRUE(std::is_sorted(near.begin(), near.end()));
    given += static_cast<int>(near.size());
    for (int t = 0; t < mesh.size(); ++t) {
      if (DistanceTo(mesh, t, p) < within) {
        ++found;
        ASSERT_THAT(near, testing::Contains(t)) << "at " << p.x << " " << p.y << " " << p.z;
      }
    }
  }
  EXPECT_GT(found, 200);
  EXPECT_LT(given, 20'000);  // of 20 000 x 96
}

TEST(TriangleGrid, AMeshWithoutTrianglesHasNothingNear) {
  const TriangleGrid grid(TriangleMesh{}, 0.1);
  std::vector<int> near = {1};
  grid.Near({0, 0, 0}, 0.1, near);
  EXPECT_THAT(near, testing::IsEmpty());
}

}  // namespace
}  // namespace calib::dem
