// Two elastic spheres colliding, against Hertz's closed form [Johnson 1985, sec. 11.4; Chung & Ooi
// 2011, test 1].
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dem/dynamics/assembly.h"
#include "dem/registry/registry.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

constexpr double kRadius = 0.01;
constexpr double kDensity = 2500;
constexpr double kModulus = 4.8e10;
constexpr double kPoisson = 0.2;
constexpr double kSpeed = 10;  // of each sphere

Model Glass() {
  Model model;
  model.contact = "hertz_mindlin";
  model.density = kDensity;
  model.parameters = {
      {"young_modulus", kModulus}, {"poisson_ratio", kPoisson}, {"friction_coefficient", 0.35}};
  return model;
}

struct Impact {
  double duration = 0;
  double peak_overlap = 0;
  double rebound = 0;       ///< speed of approach after over before
  double momentum = 0;      ///< sum of |P| after, over that of one sphere before
  double energy_ratio = 0;  ///< after over before, rotation included
};

/// Approaching along n with an optional spin of the first sphere about the cell's z axis.
Impact Collide(const double n[3], double spin) {
  Assembly assembly(test::TwoSpheres(kRadius, 2.0001 * kRadius, n), kDensity,
                    ContactModelOf(Glass()), 1);
  ParticleArrays& p = assembly.mutable_particles();
  for (std::size_t g = 0; g < 2; ++g) {
    const double sign = p.id[g] == 0 ? 1 : -1;
    p.vx[g] = sign * kSpeed * n[0];
    p.vy[g] = sign * kSpeed * n[1];
    p.vz[g] = sign * kSpeed * n[2];
    p.wz[g] = p.id[g] == 0 ? spin : 0;
  }
  const auto energy = [&] {
    double e = 0;
    for (std::size_t g = 0; g < 2; ++g) {
      e += 0.5 / p.inverse_mass[g] * (p.vx[g] * p.vx[g] + p.vy[g] * p.vy[g] + p.vz[g] * p.vz[g]);
      e += 0.5 / p.inverse_inertia[g] * (p.wx[g] * p.wx[g] + p.wy[g] * p.wy[g] + p.wz[g] * p.wz[g]);
    }
    return e;
  };
  const double before = energy();
  constexpr double kDt = 2e-8;
  Impact impact;
  EXPECT_TRUE(assembly.EvaluateForces().ok());
  for (int step = 0; step < 20000; ++step) {
    assembly.Move({.dt = kDt});
    EXPECT_TRUE(assembly.EvaluateForces().ok());
    if (assembly.contacts() > 0) {
      impact.duration += kDt;
      const double d[3] = {p.x[1] - p.x[0], p.y[1] - p.y[0], p.z[1] - p.z[0]};
      impact.peak_overlap = std::max(
          impact.peak_overlap, 2 * kRadius - std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]));
    } else if (impact.duration > 0) {
      break;
    }
  }
  double closing = 0;
  double momentum[3] = {0, 0, 0};
  for (std::size_t g = 0; g < 2; ++g) {
    const double sign = p.id[g] == 0 ? 1 : -1;
    closing += sign * (p.vx[g] * n[0] + p.vy[g] * n[1] + p.vz[g] * n[2]);
    momentum[0] += p.vx[g];
    momentum[1] += p.vy[g];
    momentum[2] += p.vz[g];
  }
  impact.rebound = -closing / (2 * kSpeed);
  impact.momentum = std::hypot(momentum[0], momentum[1], momentum[2]) / kSpeed;
  impact.energy_ratio = energy() / before;
  return impact;
}

TEST(Impact, ElasticCollisionFollowsHertz) {
  const double n[3] = {0.6, 0, 0.8};
  const Impact impact = Collide(n, 0);
  const double mass =
      kDensity * 4.0 / 3.0 * std::numbers::pi * std::pow(kRadius, 3) / 2;  // reduced
  const double radius = kRadius / 2;
  const double modulus = kModulus / (2 * (1 - kPoisson * kPoisson));
  const double speed = 2 * kSpeed;
  const double overlap =
      std::pow(15 * mass * speed * speed / (16 * std::sqrt(radius) * modulus), 0.4);
  const double duration = 2.9432 * overlap / speed;
  EXPECT_NEAR(impact.peak_overlap, overlap, 1e-3 * overlap);
  EXPECT_NEAR(impact.duration, duration, 2e-3 * duration);
  EXPECT_NEAR(impact.rebound, 1, 1e-3);
  EXPECT_LT(impact.momentum, 1e-10);
}

TEST(Impact, FrictionDissipatesAndMomentumStays) {
  const double n[3] = {0, 1, 0};
  const Impact impact = Collide(n, 2000);
  EXPECT_LT(impact.energy_ratio, 0.999);
  EXPECT_GT(impact.energy_ratio, 0.5);
  EXPECT_LT(impact.momentum, 1e-10);
}

}  // namespace
}  // namespace calib::dem
