// The largest stable step: against simulated oscillators, pairs whose rate is known, and clumps.
#include "dem/dynamics/stable_step.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace calib::dem {
namespace {

/// Whether leapfrog of one oscillator, unit mass, stays bounded in 2000 steps.
bool Bounded(double spring, double dashpot, double damping, double dt) {
  double x = 0.7;
  double v = 0.4;
  for (int k = 0; k < 2000; ++k) {
    const double force = -spring * x - dashpot * v;  // of the velocity half a step before
    const double power = force * (v + 0.5 * dt * force);
    v += dt * force * (power > 0 ? 1.0 - damping : 1.0 + damping);
    x += dt * v;
    if (!(std::abs(x) < 1e3)) {
      return false;
    }
  }
  return true;
}

TEST(StableStep, IsWhereAnOscillatorBecomesUnstable) {
  for (const double damping : {0.0, 0.2, 0.5, 0.9}) {
    const double dt = StableStep({.spring = 9.0, .dashpot = 0.0}, damping);
    EXPECT_TRUE(Bounded(9.0, 0.0, damping, 0.98 * dt)) << damping;
    EXPECT_FALSE(Bounded(9.0, 0.0, damping, 1.02 * dt)) << damping;
  }
  for (const double dashpot : {0.1, 1.0, 10.0}) {
    const double dt = StableStep({.spring = 9.0, .dashpot = dashpot}, 0.0);
    EXPECT_TRUE(Bounded(9.0, dashpot, 0.0, 0.98 * dt)) << dashpot;
    EXPECT_FALSE(Bounded(9.0, dashpot, 0.0, 1.02 * dt)) << dashpot;
  }
  EXPECT_EQ(StableStep({}, 0.2), std::numeric_limits<double>::infinity());
}

/// A contact along x with a grain that is t times lighter: springs kn, ks on arms of r.
OwnStiffness Contact(double kn, double ks, double r, double t) {
  OwnStiffness k{};
  const double share = 1.0 + t;
  k.shared[0] = share * kn;
  k.shared[1] = k.shared[2] = share * ks;
  k.shared_turn[1] = k.shared_turn[2] = share * ks * r * r;
  k.shared[3] = share * ks * r;
  return k;
}

TEST(StableStep, OfAPairIsThatOfItsReducedMass) {
  const double kn = 3e5;
  const double m1 = 2e-3;
  const double m2 = 5e-3;
  const OwnStiffness k = Contact(kn, 0.0, 1e-3, m1 / m2);
  EXPECT_NEAR(OwnRate(k, 1 / m1, 1 / (0.4 * m1 * 1e-6)), kn * (1 / m1 + 1 / m2), 1e-9 * kn / m1);
}

TEST(StableStep, BoundsSlipAndRollingFromAbove) {
  const double ks = 2e5;
  const double m = 2e-3;
  const double r = 1e-3;
  const double inertia = 0.4 * m * r * r;
  const double known = ks / m + ks * r * r / inertia;  // of one grain on a fixed one, without kn
  const double bound = OwnRate(Contact(0.0, ks, r, 0.0), 1 / m, 1 / inertia);
  EXPECT_GE(bound, known);
  EXPECT_LE(bound, 1.25 * known);
}

// Two spheres side by side, each pressed along x at its far end: turning about y or z is held by
// ks (a + r)^2, slip by the sum, and nothing couples them.
TEST(StableStep, OfAClumpKnowsItsArms) {
  const double kn = 3e5;
  const double ks = 2e5;
  const double r = 1e-3;
  const double a = 0.8e-3;
  const double mass = 4e-3;
  const double inertia = 3e-9;
  const OwnStiffness right = Contact(kn, ks, r, 0.0);
  OwnStiffness left = right;
  left.shared[3] = -left.shared[3];
  const MemberStiffness members[] = {{&right, {a, 0, 0}}, {&left, {-a, 0, 0}}};
  const double turning = 2 * ks * (a + r) * (a + r) / inertia;
  const double bound = OwnRate(members, 1 / mass, 1 / inertia);
  EXPECT_GE(bound, std::max(turning, 2 * kn / mass) * (1 - 1e-12));
  EXPECT_LE(bound, 4.0 / 3.0 * turning * (1 + 1e-12));  // two equal rates: a third above
}

}  // namespace
}  // namespace calib::dem
