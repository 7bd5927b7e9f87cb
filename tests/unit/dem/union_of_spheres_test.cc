#include "dem/particles/union_of_spheres.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dem/particles/elongation.h"

namespace calib::dem {
namespace {

constexpr double kPi = std::numbers::pi;

/// A body of revolution about its axis: volume and moments by Simpson's rule over the profile of
/// two equal spheres at -c and c.
struct Revolved {
  double volume = 0, axial = 0, transverse = 0;
};

Revolved Revolve(double r, double c) {
  Revolved sum;
  constexpr int kParts = 20000;
  for (int k = 0; k <= kParts; ++k) {
    const double s = (r + c) * (2.0 * k / kParts - 1);
    const double from = std::abs(s) - c;
    const double rho2 = std::max(0.0, r * r - from * from);
    const double weight =
        (k == 0 || k == kParts ? 1 : (k % 2 == 1 ? 4 : 2)) * 2 * (r + c) / (3.0 * kParts);
    sum.volume += weight * kPi * rho2;
    sum.axial += weight * 0.5 * kPi * rho2 * rho2;
    sum.transverse += weight * (0.25 * kPi * rho2 * rho2 + kPi * rho2 * s * s);
  }
  return sum;
}

TEST(UnionOfSpheres, OneSphereAndSpheresApartAddUp) {
  const SolidMoments one = MomentsOfUnion({{{1, 2, 3}, 0.5}});
  const double volume = 4.0 / 3.0 * kPi / 8;
  EXPECT_NEAR(one.volume, volume, 1e-14);
  EXPECT_NEAR(one.inertia[1][1], 0.4 * volume * 0.25, 1e-14);
  const SolidMoments two = MomentsOfUnion({{{0, 0, 0}, 0.5}, {{1, 0, 0}, 0.5}});
  EXPECT_NEAR(two.volume, 2 * volume, 1e-14);
  EXPECT_NEAR(two.centroid[0], 0.5, 1e-14);
  EXPECT_NEAR(two.inertia[0][0], 0.8 * volume * 0.25, 1e-14);
  EXPECT_NEAR(two.inertia[2][2], 0.8 * volume * 0.25 + 2 * volume * 0.25, 1e-14);
}

/// Largest relative error of volume and principal moments of a pair, directly or with a third
/// sphere inside the first, which changes nothing but takes the general way.
double WorstError(bool general) {
  const double axes[3][3] = {{1, 0, 0}, {0, 0.6, 0.8}, {0.48, 0.6, 0.64}};
  double worst = 0;
  for (const double c : {0.1, 0.5, 0.9}) {
    const Revolved exact = Revolve(1, c);
    for (const auto& n : axes) {
      std::vector<Sphere> spheres = {{{5 - c * n[0], -c * n[1], -c * n[2]}, 1},
                                     {{5 + c * n[0], c * n[1], c * n[2]}, 1}};
      if (general) {
        spheres.push_back({spheres[0].centre, 0.5});
      }
      const SolidMoments found = MomentsOfUnion(spheres);
      const PrincipalMoments principal = Diagonalize(found.inertia);
      EXPECT_NEAR(found.centroid[0], 5, general ? 1e-4 : 1e-12);
      for (const double error :
           {found.volume / exact.volume - 1, principal.moment[0] / exact.axial - 1,
            principal.moment[1] / exact.transverse - 1,
            principal.moment[2] / exact.transverse - 1}) {
        worst = std::max(worst, std::abs(error));
      }
      const double along = std::abs(principal.axes[0][0] * n[0] + principal.axes[0][1] * n[1] +
                                    principal.axes[0][2] * n[2]);
      EXPECT_NEAR(along, 1, 1e-6);
    }
  }
  return worst;
}

TEST(UnionOfSpheres, OverlappingPairsAreExact) { EXPECT_LT(WorstError(false), 1e-6); }

TEST(UnionOfSpheres, LinesAreWithinTheirError) {
  const double worst = WorstError(true);
  std::printf("largest relative error of lines %.2g\n", worst);
  EXPECT_LT(worst, 2e-4);
}

TEST(UnionOfSpheres, ASphereInsideAnotherCountsOnce) {
  const SolidMoments found = MomentsOfUnion({{{0, 0, 0}, 1}, {{0.2, 0.1, 0}, 0.5}});
  EXPECT_NEAR(found.volume, 4.0 / 3.0 * kPi, 1e-4 * 4);
}

TEST(UnionOfSpheres, DumbbellsHaveTheVolumeOfTheirSphere) {
  EXPECT_NEAR(DumbbellOf(1).radius, 1, 1e-15);
  for (const double aspect : {1.1, 1.4, 2.0}) {
    const Dumbbell d = DumbbellOf(aspect);
    EXPECT_NEAR(Revolve(d.radius, d.offset).volume, 4.0 / 3.0 * kPi, 1e-6);
    EXPECT_NEAR(1 + d.offset / d.radius, aspect, 1e-14);
  }
}

}  // namespace
}  // namespace calib::dem
