// Holes and notches in funnels and slides are told from their rims.
#include "dem/geometry/mesh_rims.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace calib::dem {
namespace {

using testing::HasSubstr;

/// 16 sides in `layers` rings, triangles ring by ring.
TriangleMesh Funnel(int layers) {
  TriangleMesh mesh;
  for (int k = 0; k < layers; ++k) {
    const auto radius = [layers](int at) { return 0.03 + 0.04 * at / layers; };
    AddFrustum({.centre = {0, 0, 0.07 * k / layers},
                .height = 0.07 / layers,
                .lower_radius = radius(k),
                .upper_radius = radius(k + 1),
                .sides = 16},
               mesh);
  }
  return mesh;
}

TriangleMesh Without(TriangleMesh mesh, const std::vector<int>& triangles) {
  for (auto it = triangles.rbegin(); it != triangles.rend(); ++it) {
    mesh.triangle.erase(mesh.triangle.begin() + *it);
  }
  return mesh;
}

/// Turned about the axis of y by an angle; the outlet stays around the origin.
TriangleMesh Tilted(TriangleMesh mesh, double angle) {
  for (Vec3& v : mesh.vertex) {
    v = {std::cos(angle) * v.x - std::sin(angle) * v.z, v.y,
         std::sin(angle) * v.x + std::cos(angle) * v.z};
  }
  return mesh;
}

TEST(FunnelRims, WholeFunnelsHaveTwo) {
  EXPECT_EQ(FunnelProblem(Funnel(1)), "");
  EXPECT_EQ(FunnelProblem(Funnel(4)), "");
  EXPECT_EQ(FunnelProblem(Tilted(Funnel(4), 0.2)), "");
  EXPECT_EQ(FunnelProblem(Shifted(Funnel(4), {0.1, 0, 0})), "");
  TriangleMesh solid = Funnel(1);  // with a thickness: closed
  AddFrustum({.height = 0.07, .lower_radius = 0.032, .upper_radius = 0.072, .sides = 16}, solid);
  AddFrustum({.height = 0, .lower_radius = 0.03, .upper_radius = 0.032, .sides = 16}, solid);
  AddFrustum({.centre = {0, 0, 0.07},
              .height = 0,
              .lower_radius = 0.07,
              .upper_radius = 0.072,
              .sides = 16},
             solid);
  EXPECT_EQ(FunnelProblem(solid), "");
  EXPECT_THAT(FunnelProblem(Without(solid, {3})), HasSubstr("has 1 loop of edges of one triangle"));
}

TEST(FunnelRims, MissingTrianglesAreFound) {
  for (int t = 0; t < Funnel(1).size(); ++t) {  // each lies at a rim and reaches to the other
    EXPECT_THAT(FunnelProblem(Without(Funnel(1), {t})), HasSubstr("a notch that touches a rim"))
        << t;
  }
  EXPECT_NE(FunnelProblem(Without(Funnel(1), {4, 5, 6, 7})), "");
  EXPECT_NE(FunnelProblem(Without(Funnel(1), {0, 9, 17, 26})), "");
  for (int t = 0; t < Funnel(4).size(); ++t) {
    EXPECT_NE(FunnelProblem(Without(Funnel(4), {t})), "") << t;
  }
  for (int t = 0; t + 3 < Funnel(4).size(); ++t) {
    EXPECT_NE(FunnelProblem(Without(Funnel(4), {t, t + 1, t + 2, t + 3})), "") << t;
  }
  EXPECT_THAT(FunnelProblem(Without(Funnel(4), {45})),
              HasSubstr("has a hole: it has 3 loops of edges of one triangle only, the shortest of "
                        "3 edges around (-0.0"));
  EXPECT_THAT(FunnelProblem(Without(Funnel(4), {44, 45, 46, 47})), HasSubstr("of 6 edges around"));
  EXPECT_THAT(FunnelProblem(Without(Funnel(4), {4})), HasSubstr("has a notch in its outlet at ("));
  // The outlet is closed by a fan, and the wall has a hole: two loops, but no outlet.
  TriangleMesh blind = Funnel(4);
  AddFrustum({.height = 0, .lower_radius = 0, .upper_radius = 0.03, .sides = 16}, blind);
  EXPECT_THAT(FunnelProblem(blind), HasSubstr("has 1 loop"));
  EXPECT_THAT(FunnelProblem(Without(blind, {45})),
              HasSubstr("has a hole in place of its outlet: a loop of 3 edges"));
}

/// Six by six squares, sloping up along x, y from -0.03 to 0.03.
TriangleMesh Slide() {
  TriangleMesh mesh;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      const auto at = [](int k, int l) { return Vec3{0.01 * k, 0.01 * (l - 3), 0.01 * k}; };
      AddQuad(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1), mesh);
    }
  }
  return mesh;
}

TEST(SlideRims, MissingTrianglesAreFound) {
  constexpr double kReach = 0.025;
  EXPECT_EQ(SlideProblem(Slide()), "");
  EXPECT_EQ(SlideProblemAcross(Slide(), kReach), "");
  EXPECT_EQ(SlideProblemAcross(Slide(), 0.03), "");
  int outside = 0;  // triangles of which nothing lies in the slice but what the sides leave of it
  for (int t = 0; t < Slide().size(); ++t) {
    const TriangleMesh mesh = Without(Slide(), {t});
    const std::string problem = SlideProblem(mesh);
    outside += problem.empty() && SlideProblemAcross(mesh, kReach).empty() ? 1 : 0;
  }
  for (int t = 0; t + 3 < Slide().size(); ++t) {
    const TriangleMesh mesh = Without(Slide(), {t, t + 1, t + 2, t + 3});
    const std::string problem = SlideProblem(mesh);
    outside += problem.empty() && SlideProblemAcross(mesh, kReach).empty() ? 1 : 0;
  }
  EXPECT_EQ(outside, 0);
  EXPECT_THAT(SlideProblem(Without(Slide(), {30})),
              HasSubstr("has a hole: it has 2 loops of edges of one triangle only, the shortest of "
                        "3 edges around (0.02"));
  EXPECT_THAT(SlideProblem(Without(Slide(), {28, 29, 30, 31})), HasSubstr("of 6 edges around"));
  // At the lower end, at a side, and one half of a plate of two triangles.
  EXPECT_THAT(SlideProblemAcross(Without(Slide(), {5}), kReach), HasSubstr("has a notch"));
  EXPECT_THAT(SlideProblemAcross(Without(Slide(), {24}), kReach), HasSubstr("notch in its side"));
  TriangleMesh plate;
  AddQuad({0, -0.03, 0}, {0.06, -0.03, 0.06}, {0.06, 0.03, 0.06}, {0, 0.03, 0}, plate);
  EXPECT_EQ(SlideProblemAcross(plate, 0.03), "");
  for (const int t : {0, 1}) {
    EXPECT_NE(SlideProblemAcross(Without(plate, {t}), kReach), "") << t;
  }
  EXPECT_THAT(SlideProblemAcross(Slide(), 0.04), HasSubstr("ends within the slice"));
}

}  // namespace
}  // namespace calib::dem
