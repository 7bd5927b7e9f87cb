// Restitution of the viscoelastic laws between two grains, between disks and at walls: it depends
// on the reduced mass m* and radius r* only. By the test `collision` and by the engine of the
// specimens.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "dem/dynamics/assembly.h"
#include "dem/registry/catalog.h"
#include "dem/registry/registry.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

constexpr double kRadius = 0.02225;
constexpr double kDensity = 7668;
constexpr double kModulus = 2.1e11;
constexpr double kPoisson = 0.3;

/// Two bodies that meet head on: a body of kRadius and its partner.
struct Pair {
  std::string name;
  double partner = 0;    ///< radius [m]; 0: a wall
  double thickness = 0;  ///< of disks [m]; 0: spheres
};

const std::vector<Pair> kPairs = {{"two spheres", kRadius, 0},
                                  {"a sphere and a smaller one", 0.4 * kRadius, 0},
                                  {"two disks", kRadius, 0.01},
                                  {"a disk and a smaller one", 0.4 * kRadius, 0.01},
                                  {"a disk and a wall", 0, 0.01}};

double MassOf(double radius, double thickness) {
  return kDensity * std::numbers::pi * radius * radius *
         (thickness > 0 ? thickness : 4.0 / 3.0 * radius);
}

double ReducedMass(const Pair& pair) {
  const double m = MassOf(kRadius, pair.thickness);
  const double partner = MassOf(pair.partner, pair.thickness);
  return pair.partner > 0 ? m * partner / (m + partner) : m;
}

/// k of F = k u^1.5: 4/3 E* sqrt(r*)
double Stiffness(const Pair& pair) {
  const double radius =
      pair.partner > 0 ? kRadius * pair.partner / (kRadius + pair.partner) : kRadius;
  return 2 * kModulus / (3 * (1 - kPoisson * kPoisson)) * std::sqrt(radius);
}

Model Law(const std::string& contact, double damping, double exponent) {
  Model model;
  model.contact = contact;
  model.density = kDensity;
  model.parameters = {{"young_modulus", kModulus},
                      {"poisson_ratio", kPoisson},
                      {"friction_coefficient", 0},
                      {"tangential_stiffness", 1e8},
                      {"damping", damping}};
  if (contact == "extended_viscoelastic") {
    model.parameters["damping_exponent"] = exponent;
  }
  return model;
}

/// Restitution by the test `collision`.
double ByCollision(const Model& model, const Pair& pair, double speed) {
  Scenario s;
  s.model = model;
  s.test = "collision";
  s.settings = {{"radius", kRadius}, {"impact_angle", 0}, {"thickness", pair.thickness}};
  if (pair.partner > 0) {
    s.settings["partner_radius"] = pair.partner;
  }
  s.path = {{.target = speed, .load_step = 0}};
  const test::Run run = test::RunAll(s);
  const auto& names = FindTest("collision")->observables;
  for (std::size_t k = 0; k < names.size() && !run.states.empty(); ++k) {
    if (names[k] == "normal_restitution") {
      return run.states[0].values[k];
    }
  }
  ADD_FAILURE() << run.summary.reason;
  return -1;
}

/// Largest overlap of the elastic contact and the time that it takes.
double Peak(const Pair& pair, double speed) {
  return std::pow(1.25 * ReducedMass(pair) * speed * speed / Stiffness(pair), 0.4);
}

/// Restitution by the engine, in the plane of x and z; partners fly at each other, the body falls
/// on a wall. 10 000 steps in the contact.
double ByEngine(const Model& model, const Pair& pair, double speed) {
  Packing packing;
  packing.length[0] = packing.length[1] = packing.length[2] = 20 * kRadius;
  const double gap = 0.5 * Peak(pair, speed);
  const double x = 10 * kRadius;
  packing.x = {x};
  packing.y = {x};
  packing.z = {pair.partner > 0 ? x : kRadius + gap};
  packing.radius = {kRadius};
  packing.clump = {-1};
  Surroundings around{.planar = true, .thickness = pair.thickness};
  if (pair.partner > 0) {
    packing.x.push_back(x);
    packing.y.push_back(x);
    packing.z.push_back(x - kRadius - pair.partner - gap);
    packing.radius.push_back(pair.partner);
    packing.clump.push_back(-1);
  } else {
    around.walls = {MakePlane("floor", {0, 0, 0}, {0, 0, 1})};
  }
  Assembly assembly(packing, kDensity, ContactModelOf(model, pair.thickness), around, 1);
  const auto approach = [&] {  // of the first grain and its partner
    const ParticleArrays& p = assembly.particles();
    double v = 0;
    for (std::size_t g = 0; g < p.z.size(); ++g) {
      v += p.id[g] == 0 ? -p.vz[g] : p.vz[g];
    }
    return v;
  };
  ParticleArrays& p = assembly.mutable_particles();
  for (std::size_t g = 0; g < p.z.size(); ++g) {
    const double share = pair.partner > 0 ? 0.5 : 1;
    p.vz[g] = (p.id[g] == 0 ? -share : share) * speed;
  }
  EXPECT_TRUE(assembly.EvaluateForces().ok());
  const double dt = 2.9432 * Peak(pair, speed) / speed / 10000;
  bool touched = false;
  for (int step = 0; step < 100000; ++step) {
    assembly.Move({.dt = dt});
    EXPECT_TRUE(assembly.EvaluateForces().ok());
    const bool touches = assembly.contacts() + assembly.walls().contacts() > 0;
    if (touched && !touches) {
      return -approach() / speed;
    }
    touched |= touches;
  }
  ADD_FAILURE() << pair.name << ": still in contact";
  return -1;
}

/// Restitution of m* u'' = -k u^1.5 - gamma u' u^alpha until u = 0, by the classical Runge-Kutta
/// method with 20 000 steps in the elastic contact; the last one is cut by Newton's method.
double Integrated(const Pair& pair, double damping, double alpha, double speed) {
  const double mass = ReducedMass(pair);
  const double stiffness = Stiffness(pair);
  const auto acceleration = [&](double u, double v) {
    const double x = u > 0 ? u : 0;
    return -(stiffness * x * std::sqrt(x) + damping * v * std::pow(x, alpha)) / mass;
  };
  const double h = 2.9432 * Peak(pair, speed) / speed / 20000;
  double u = 0;
  double v = speed;
  for (int step = 0; step < 400000; ++step) {
    const double a1 = acceleration(u, v);
    const double v2 = v + 0.5 * h * a1;
    const double a2 = acceleration(u + 0.5 * h * v, v2);
    const double v3 = v + 0.5 * h * a2;
    const double a3 = acceleration(u + 0.5 * h * v2, v3);
    const double v4 = v + h * a3;
    const double a4 = acceleration(u + h * v3, v4);
    const double next = u + h / 6 * (v + 2 * v2 + 2 * v3 + v4);
    if (next < 0) {
      return -(v + u / -v * a1) / speed;
    }
    u = next;
    v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
  }
  ADD_FAILURE() << pair.name << ": still in contact";
  return -1;
}

// gamma = -sqrt(5) ln e/sqrt(ln^2 e + pi^2) sqrt(m* k) [Antypov & Elliott 2011], any speed.
TEST(ViscoelasticPairs, TsujiRestitutionIsItsClosedForm) {
  for (const Pair& pair : kPairs) {
    SCOPED_TRACE(pair.name);
    for (const double e : {0.9, 0.5}) {
      const double l = std::log(e);
      const Model law = Law("tsuji",
                            -std::sqrt(5.0) * l / std::hypot(l, std::numbers::pi) *
                                std::sqrt(ReducedMass(pair) * Stiffness(pair)),
                            0.25);
      for (const double speed : {0.1, 3.0}) {
        EXPECT_NEAR(ByCollision(law, pair, speed), e, 1e-4);
      }
      EXPECT_NEAR(ByEngine(law, pair, 1), e, 1e-4);
    }
  }
}

// e = 1 - x + 3/5 x^2 - ..., x the loss of first order, ~ v^{1/5} [Schwager & Poeschel 1998; Ramirez
// et al. 1999]; strong dashpots by integration.
TEST(ViscoelasticPairs, KuwabaraKonoRestitutionIsItsSeries) {
  for (const Pair& pair : kPairs) {
    SCOPED_TRACE(pair.name);
    const double mass = ReducedMass(pair);
    for (const double speed : {0.1, 3.0}) {
      const double peak = Peak(pair, speed);
      const double loss = 0.8 * std::beta(0.6, 1.5) * std::pow(peak, 1.5) / (mass * speed);
      for (const double x : {0.02, 0.1}) {
        const double damping = x / loss;
        const double e = ByCollision(Law("kuwabara_kono", damping, 0.5), pair, speed);
        EXPECT_NEAR(e, 1 - x + 0.6 * x * x, 0.5 * x * x * x + 2e-5);
        EXPECT_NEAR(ByEngine(Law("kuwabara_kono", damping, 0.5), pair, speed), e, 1e-4);
      }
      EXPECT_NEAR(ByCollision(Law("kuwabara_kono", 0.8 / loss, 0.5), pair, speed),
                  Integrated(pair, 0.8 / loss, 0.5, speed), 1e-4);
    }
  }
}

TEST(ViscoelasticPairs, ExtendedLawFollowsItsIntegral) {
  for (const Pair& pair : kPairs) {
    SCOPED_TRACE(pair.name);
    for (const double alpha : {0.1, 0.65, 1.0}) {
      for (const double speed : {0.1, 3.0}) {
        const double peak = Peak(pair, speed);
        const double damping =
            0.4 * ReducedMass(pair) * speed / std::pow(peak, alpha + 1);  // loses about a half
        const Model law = Law("extended_viscoelastic", damping, alpha);
        const double expected = Integrated(pair, damping, alpha, speed);
        EXPECT_GT(expected, 0.3);
        EXPECT_LT(expected, 0.9);
        EXPECT_NEAR(ByCollision(law, pair, speed), expected, 1e-4);
        EXPECT_NEAR(ByEngine(law, pair, speed), expected, 1e-4);
      }
    }
  }
}

}  // namespace
}  // namespace calib::dem
