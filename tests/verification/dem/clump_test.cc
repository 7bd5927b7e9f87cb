// Rigid clumps: pendulum, free top, balances of a collision, and clumps in lab tests.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dem/dynamics/assembly.h"
#include "dem/lab_tests/shared/shape_change.h"
#include "dem/particles/disk_pair.h"
#include "dem/particles/elongation.h"
#include "dem/registry/catalog.h"
#include "dem/registry/registry.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

constexpr double kRadius = 0.01;
constexpr double kDensity = 2500;
const double kSphere = kDensity * 4.0 / 3.0 * std::numbers::pi * std::pow(kRadius, 3);

Packing Spheres(const std::vector<std::array<double, 3>>& centres, const std::vector<int>& clump) {
  Packing p;
  for (double& length : p.length) {
    length = 1;
  }
  for (const auto& c : centres) {
    p.x.push_back(c[0]);
    p.y.push_back(c[1]);
    p.z.push_back(c[2]);
    p.radius.push_back(kRadius);
  }
  p.clump = clump;
  return p;
}

// Two spheres that touch, hung up at the centre of one: T = 2 pi sqrt((I + M r^2)/(M g r)), I = 2
// (2/5 + 1) m r^2, times 1 + a^2/16 for the amplitude a. The pivot is a stiff spring.
TEST(Clump, PendulumSwingsWithItsPeriod) {
  constexpr double kGravity = 9.81;
  constexpr double kAmplitude = 0.05;
  const double s = 2 * kRadius * std::sin(kAmplitude);
  const double c = 2 * kRadius * std::cos(kAmplitude);
  const Packing packing = Spheres({{0.5, 0.5, 0.5}, {0.5 + s, 0.5, 0.5 - c}}, {7, 7});
  ParticleArrays p = MakeParticles(packing, kDensity);
  RigidClumps clumps(packing, {.density = kDensity}, p);
  ASSERT_EQ(clumps.all().size(), 1U);
  EXPECT_NEAR(clumps.all()[0].mass, 2 * kSphere, 1e-12 * kSphere);
  const PeriodicCell cell{.length = {1, 1, 1}};
  const double weight = 2 * kSphere * kGravity;
  const double stiffness = 1e4 * weight / kRadius;
  const double period = 2 * std::numbers::pi * std::sqrt(2.4 * kRadius / kGravity) *
                        (1 + kAmplitude * kAmplitude / 16);
  const double dt = period / 100000;
  const std::size_t held = p.id[0] == 0 ? 0 : 1;
  double last = s;
  std::vector<double> crossings;
  for (int step = 0; step < 350000; ++step) {
    p.fx = {0, 0};
    p.fy = {0, 0};
    p.fz = {-0.5 * weight, -0.5 * weight};
    p.tx = p.ty = p.tz = {0, 0};
    p.fx[held] -= stiffness * (p.x[held] - 0.5);
    p.fy[held] -= stiffness * (p.y[held] - 0.5);
    p.fz[held] -= stiffness * (p.z[held] - 0.5);
    clumps.Advance({.dt = dt}, {}, cell, 1, p);
    const double now = p.x[1 - held] - p.x[held];
    if (last > 0 && now <= 0) {
      crossings.push_back((step + now / (last - now)) * dt);
    }
    last = now;
  }
  ASSERT_GE(crossings.size(), 3U);
  const double found = (crossings.back() - crossings.front()) / (crossings.size() - 1);
  std::printf("period over closed form %.6f\n", found / period);
  EXPECT_NEAR(found, period, 5e-4 * period);
}

/// Grains between walls with real gravity and 1 GPa.
Assembly Heavy(const Packing& packing, double friction, Surroundings surroundings) {
  Model model = test::HertzModel();
  model.density = kDensity;
  model.parameters["friction_coefficient"] = friction;
  return {packing, kDensity, ContactModelOf(model), std::move(surroundings), 1};
}

// An L of three spheres weighs what it weighs, once, at its centre of mass: it falls with g and
// does not turn; under drag it comes to g/drag.
TEST(Clump, FallsWithGravityAndDoesNotTurn) {
  const Packing packing =
      Spheres({{0.47, 0.5, 0.5}, {0.47, 0.515, 0.5}, {0.458, 0.5, 0.503}}, {3, 3, 3});
  Assembly assembly = Heavy(packing, 0.5, {.gravity = {1, 2, -9.81}});
  ASSERT_TRUE(assembly.EvaluateForces().ok());
  const Clump start = assembly.clumps().all()[0];
  for (int step = 0; step < 1000; ++step) {
    assembly.Move({.dt = 1e-5});
    ASSERT_TRUE(assembly.EvaluateForces().ok());
  }
  const Clump& body = assembly.clumps().all()[0];
  const double g[3] = {1, 2, -9.81};
  for (std::size_t a = 0; a < 3; ++a) {
    EXPECT_NEAR(body.velocity[a], 0.01 * g[a], 1e-12);
    EXPECT_NEAR(body.centre[a] - start.centre[a], 0.5 * 1e-4 * g[a], 1e-3 * 0.5 * 1e-4 * 9.81);
    EXPECT_NEAR(body.momentum[a], 0, 1e-18);
  }
  for (int step = 0; step < 2000; ++step) {
    assembly.Move({.dt = 1e-5, .drag = 1000});
    ASSERT_TRUE(assembly.EvaluateForces().ok());
  }
  EXPECT_NEAR(assembly.clumps().all()[0].velocity[2], -9.81 / 1000, 0.02 * 9.81 / 1000);
}

// Two spheres side by side roll down an incline as one does: I = 2 (2/5) m r^2 about their line, so
// that the acceleration is 5/7 g sin(alpha); the floor bears their weight.
TEST(Clump, RollsDownAnInclineWithFiveSeventhsOfGravity) {
  constexpr double kAlpha = 0.3;
  const double g = 9.81;
  const double kn = 2 * 8e8 / (3 * (1 - 0.04)) * std::sqrt(kRadius);  // F = kn u^1.5
  const double overlap = std::pow(kSphere * g * std::cos(kAlpha) / kn, 2.0 / 3.0);
  const double height = kRadius - overlap;
  const Packing packing = Spheres({{0.2, 0.49, height}, {0.2, 0.49 + 2 * kRadius, height}}, {0, 0});
  Assembly assembly = Heavy(packing, 0.4,
                            {.gravity = {g * std::sin(kAlpha), 0, -g * std::cos(kAlpha)},
                             .walls = {MakePlane("floor", {0, 0, 0}, {0, 0, 1})}});
  ASSERT_TRUE(assembly.EvaluateForces().ok());
  const double dt = 0.1 * assembly.NominalCriticalStep();
  const int steps = static_cast<int>(0.05 / dt);
  double borne = 0;
  for (int step = 0; step < steps; ++step) {
    assembly.Move({.dt = dt});
    ASSERT_TRUE(assembly.EvaluateForces().ok());
    borne -= assembly.walls().ForceOn(0).z / steps;
  }
  const Clump& body = assembly.clumps().all()[0];
  const double expected = 5.0 / 7.0 * g * std::sin(kAlpha) * steps * dt;
  std::printf("speed over closed form %.5f, weight on the floor %.5f\n",
              body.velocity[0] / expected, borne / (2 * kSphere * g * std::cos(kAlpha)));
  EXPECT_NEAR(body.velocity[0], expected, 2e-3 * expected);
  EXPECT_NEAR(borne, 2 * kSphere * g * std::cos(kAlpha), 2e-3 * borne);
  EXPECT_NEAR(assembly.particles().wy[0], expected / kRadius, 3e-3 * expected / kRadius);
}

// A dumbbell spun off its axis precesses about its angular momentum with L/I_t; both its energy and
// the momentum stay.
TEST(Clump, FreeTopPrecesses) {
  const Packing packing = Spheres({{0.5, 0.5, 0.5}, {0.5, 0.5, 0.5 + 2 * kRadius}}, {0, 0});
  ParticleArrays p = MakeParticles(packing, kDensity);
  RigidClumps clumps(packing, {.density = kDensity}, p);
  Clump& body = clumps.mutable_all()[0];
  const double axial = 0.8 * kSphere * kRadius * kRadius;
  const double transverse = 2.8 * kSphere * kRadius * kRadius;
  EXPECT_NEAR(body.inertia[0], axial, 1e-12 * axial);
  EXPECT_NEAR(body.inertia[2], transverse, 1e-12 * transverse);
  const double l[3] = {axial * 30, 0, axial * 40};  // 40 rad/s about the axis
  body.momentum = {l[0], l[1], l[2]};
  const double size = axial * 50;
  const double precession = size / transverse;
  const PeriodicCell cell{.length = {1, 1, 1}};
  p.fx = p.fy = p.fz = p.tx = p.ty = p.tz = {0, 0};
  const int steps = 20000;
  const double dt = 0.75 * std::numbers::pi / precession / steps;  // 3/8 of a turn
  for (int k = 0; k < steps; ++k) {
    clumps.Advance({.dt = dt}, {}, cell, 1, p);
  }
  EXPECT_EQ(body.momentum[0], l[0]);
  EXPECT_EQ(body.momentum[2], l[2]);
  // Axis z turned about L by 135 degrees.
  const double u[3] = {0.6, 0, 0.8};
  const double angle = 0.75 * std::numbers::pi;
  const double along = u[2];
  const double expected[3] = {u[0] * along * (1 - std::cos(angle)), -u[0] * std::sin(angle),
                              std::cos(angle) + u[2] * along * (1 - std::cos(angle))};
  const std::size_t top = p.id[0] == 1 ? 0 : 1;
  EXPECT_NEAR((p.x[top] - body.centre[0]) / kRadius, expected[0], 1e-6);
  EXPECT_NEAR((p.y[top] - body.centre[1]) / kRadius, expected[1], 1e-6);
  EXPECT_NEAR((p.z[top] - body.centre[2]) / kRadius, expected[2], 1e-6);
}

// Two disks (or spheres) in a plane fall slantwise onto a smooth, hard floor. The impulse at the
// touching member's arm x from the centre is J = 2 m v / (1 + m x^2/I), so that the speed after is
// v - 2 v/(1 + m x^2/I) downwards and the spin 2 v x / (I/m + x^2).
TEST(Clump, InAPlaneAPairBouncesAsItsMassAndMomentSay) {
  constexpr double kSpeed = 0.01;
  for (const double thickness : {0.0, 0.7 * kRadius}) {
    const double offset = 0.6 * kRadius;
    const double cos = 0.8;
    const double height = kRadius + 0.6 * offset + 1e-7;
    const Packing packing = Spheres({{0.2 - cos * offset, 0.49, height - 0.6 * offset},
                                     {0.2 + cos * offset, 0.49, height + 0.6 * offset}},
                                    {0, 0});
    Model model = test::HertzModel();
    model.parameters["friction_coefficient"] = 0;
    Assembly assembly(packing, kDensity, ContactModelOf(model, thickness),
                      {.walls = {MakePlane("floor", {0, 0, 0}, {0, 0, 1})},
                       .planar = true,
                       .thickness = thickness},
                      1);
    Clump& body = assembly.mutable_clumps().mutable_all()[0];
    body.velocity = {0, 0, -kSpeed};
    const double area = MomentsOfDiskPair(kRadius, offset).area;
    if (thickness > 0) {
      EXPECT_NEAR(body.mass, kDensity * thickness * area, 1e-12 * body.mass);
    }
    ASSERT_TRUE(assembly.EvaluateForces().ok());
    const double dt = 0.02 * assembly.NominalCriticalStep();
    bool met = false;
    for (int step = 0; step < 1'000'000; ++step) {
      assembly.Move({.dt = dt});
      ASSERT_TRUE(assembly.EvaluateForces().ok());
      const bool touches = assembly.walls().ForceOn(0).z != 0;
      if (met && !touches) {
        break;
      }
      met = met || touches;
    }
    ASSERT_TRUE(met);
    const double x = -cos * offset;
    const double gyration2 = body.inertia[1] / body.mass;
    const double up = -kSpeed + 2 * kSpeed / (1 + x * x / gyration2);
    const double spin = 2 * kSpeed * x / (gyration2 + x * x);
    const ParticleArrays& p = assembly.particles();
    std::printf("thickness %g: speed %.6f, closed form %.6f; spin %.5f, %.5f\n", thickness,
                body.velocity[2], up, p.wy[0], -spin);
    EXPECT_NEAR(body.velocity[2], up, 1e-3 * kSpeed);
    EXPECT_NEAR(p.wy[0], -spin, 1e-3 * std::abs(spin));  // about y, from z to x
    for (std::size_t k = 0; k < 2; ++k) {
      EXPECT_EQ(p.y[k], 0.49);
      EXPECT_EQ(p.wx[k], 0);
      EXPECT_EQ(p.wz[k], 0);
    }
  }
}

// A dumbbell that joins later has the same bits as one that was there from the beginning.
TEST(Clump, OneThatJoinsMovesLikeOneThatWasThere) {
  const std::vector<std::array<double, 3>> places = {{0.2, 0.5, 1.01 * kRadius},
                                                     {0.2, 0.5 + kRadius, 1.3 * kRadius}};
  const auto floor = [] {
    return Surroundings{.gravity = {0, 0, -9.81}, .walls = {MakePlane("floor", {}, {0, 0, 1})}};
  };
  Assembly there = Heavy(Spheres({places[0], places[1]}, {0, 0}), 0.4, floor());
  Assembly joined = Heavy(Spheres({places[0], places[1]}, {0, 0}), 0.4, floor());
  joined.Remove({0, 1});
  std::vector<NewGrain> grains;
  for (const auto& at : places) {
    grains.push_back(
        {.centre = {at[0], at[1], at[2]}, .velocity = {0.1, 0, 0}, .radius = kRadius, .clump = 7});
  }
  joined.Insert(grains);
  there.mutable_clumps().mutable_all()[0].velocity = {0.1, 0, 0};
  ASSERT_EQ(joined.clumps().all().size(), 1U);
  EXPECT_EQ(joined.solid_volume(), there.solid_volume());
  ASSERT_TRUE(there.EvaluateForces().ok());
  ASSERT_TRUE(joined.EvaluateForces().ok());
  const double dt = 0.1 * there.NominalCriticalStep();
  for (int step = 0; step < 3000; ++step) {
    for (Assembly* assembly : {&there, &joined}) {
      assembly->Move({.dt = dt});
      ASSERT_TRUE(assembly->EvaluateForces().ok());
    }
  }
  const Clump& a = there.clumps().all()[0];
  const Clump& b = joined.clumps().all()[0];
  EXPECT_NE(a.momentum[0], 0);  // it has met the floor
  EXPECT_EQ(a.centre, b.centre);
  EXPECT_EQ(a.orientation, b.orientation);
  EXPECT_EQ(a.momentum, b.momentum);
}

// An L of three overlapping spheres hits a dumbbell, elastic and frictionless: momentum, angular
// momentum and energy after are those before.
TEST(Clump, CollisionKeepsMomentumAngularMomentumAndEnergy) {
  const Packing packing = Spheres({{0.47, 0.5, 0.5},
                                   {0.47, 0.515, 0.5},
                                   {0.458, 0.5, 0.503},
                                   {0.4975, 0.508, 0.498},
                                   {0.4975, 0.488, 0.498}},
                                  {3, 3, 3, 1, 1});
  Model model = test::HertzModel();
  model.parameters["friction_coefficient"] = 0;
  Assembly assembly(packing, kDensity, ContactModelOf(model), 1);
  ASSERT_EQ(assembly.clumps().all().size(), 2U);
  ASSERT_EQ(assembly.bodies(), 2);
  for (Clump& c : assembly.mutable_clumps().mutable_all()) {
    const bool thrown = c.members.size() == 3;
    c.velocity = {thrown ? 1.0 : 0.0, 0, 0};
    if (thrown) {
      c.momentum = {0, 0, 3 * c.inertia[2]};
    }
  }
  struct Sums {
    std::array<double, 3> linear{}, angular{};
    double energy = 0;
  };
  const auto sums = [&assembly] {
    Sums s;
    for (const Clump& c : assembly.clumps().all()) {
      for (std::size_t a = 0; a < 3; ++a) {
        const std::size_t b = (a + 1) % 3;
        const std::size_t d = (a + 2) % 3;
        s.linear[a] += c.mass * c.velocity[a];
        s.angular[a] += c.momentum[a] + c.mass * ((c.centre[b] - 0.5) * c.velocity[d] -
                                                  (c.centre[d] - 0.5) * c.velocity[b]);
        s.energy += 0.5 * c.mass * c.velocity[a] * c.velocity[a];
      }
      const std::size_t m = static_cast<std::size_t>(c.members.front());
      const ParticleArrays& p = assembly.particles();
      s.energy +=
          0.5 * (c.momentum[0] * p.wx[m] + c.momentum[1] * p.wy[m] + c.momentum[2] * p.wz[m]);
    }
    return s;
  };
  ASSERT_TRUE(assembly.EvaluateForces().ok());
  EXPECT_EQ(assembly.contacts(), 0);
  assembly.Move({.dt = 1e-7});  // gives the members the bodies' spins
  ASSERT_TRUE(assembly.EvaluateForces().ok());
  const Sums before = sums();
  std::int64_t touched = 0;
  for (int step = 0; step < 200000; ++step) {
    assembly.Move({.dt = 1e-7});
    ASSERT_TRUE(assembly.EvaluateForces().ok());
    touched += assembly.contacts();
  }
  EXPECT_GT(touched, 100);
  EXPECT_EQ(assembly.contacts(), 0);
  const Sums after = sums();
  const double scale = std::abs(before.linear[0]);
  for (std::size_t a = 0; a < 3; ++a) {
    EXPECT_NEAR(after.linear[a], before.linear[a], 1e-12 * scale);
    EXPECT_NEAR(after.angular[a], before.angular[a], 1e-7 * scale * kRadius);
  }
  EXPECT_NE(after.linear[0], 0);
  EXPECT_GT(
      std::abs(assembly.clumps().all()[1].velocity[0] - assembly.clumps().all()[0].velocity[0]),
      0.1);
  std::printf("energy after over before %.7f\n", after.energy / before.energy);
  EXPECT_NEAR(after.energy / before.energy, 1, 1e-4);
}

Scenario Elongated13(double aspect) {
  Scenario s = test::SmallTriaxial(test::HertzModel());
  s.packing = test::SmallPacking(200);
  s.model.effects = {"nonspherical_shape"};
  s.model.parameters["nonspherical_shape.aspect"] = aspect;
  s.path = {{.target = 0, .load_step = 0}, {.target = 0.02, .load_step = 1}};
  return s;
}

double At(const State& state, const std::string& name) {
  const auto& names = FindTest("triaxial_drained")->observables;
  return state.values[static_cast<std::size_t>(std::find(names.begin(), names.end(), name) -
                                               names.begin())];
}

TEST(NonsphericalShape, KeepsVolumesAndLetsTheGrainsGiveWay) {
  const Packing& spheres = test::SmallPacking(200);
  const auto packing = Elongate(spheres, 1.3, 1, {});
  ASSERT_TRUE(packing.ok()) << packing.status();
  Model model = test::LinearModel();
  Assembly before(spheres, 2650, ContactModelOf(model), 1);
  Assembly after(*packing, 2650, ContactModelOf(model), 1);
  EXPECT_EQ(after.bodies(), 200);
  EXPECT_NEAR(after.solid_volume(), before.solid_volume(), 1e-4 * before.solid_volume());
  EXPECT_NEAR(after.mean_diameter(), before.mean_diameter(), 1e-4 * before.mean_diameter());
  ASSERT_TRUE(after.EvaluateForces().ok());
  double largest = 0;
  const auto& list = after.neighbors();
  for (int s = 0; s < list.size(); ++s) {
    if (after.touching(s)) {
      largest = std::max(largest, Length(after.force_on_j(s)));
    }
  }
  // kn = 2 E r*: overlap over radius; jammed grains would keep percents.
  std::printf("largest overlap %.2g of a radius\n", largest / (1.2e8 * 1e-3 * 1e-3));
  EXPECT_LT(largest / (1.2e8 * 1e-3 * 1e-3), 2e-2);
}

// Near the null the specimen is nearly that of spheres; what density it settles at is printed.
TEST(NonsphericalShape, PorosityAfterConsolidation) {
  Scenario s = Elongated13(1);
  s.path = {{.target = 0, .load_step = 0}};
  const double spheres = At(test::RunAll(s).states[0], "porosity");
  for (const double aspect : {1.02, 1.1, 1.3}) {
    s.model.parameters["nonspherical_shape.aspect"] = aspect;
    const test::Run run = test::RunAll(s);
    ASSERT_EQ(run.summary.outcome, Outcome::kCompleted) << run.summary.reason;
    std::printf("aspect %.2f: porosity %.4f (spheres %.4f)\n", aspect,
                At(run.states[0], "porosity"), spheres);
    EXPECT_NEAR(At(run.states[0], "porosity"), spheres, aspect < 1.05 ? 0.01 : 0.05);
  }
}

TEST(NonsphericalShape, RunsOnAnyNumberOfThreadsToTheSameBits) {
  Scenario s = Elongated13(1.3);
  const test::Run one = test::RunAll(s);
  ASSERT_EQ(one.summary.outcome, Outcome::kCompleted) << one.summary.reason;
  s.threads = 2;
  const test::Run two = test::RunAll(s);
  for (std::size_t k = 0; k < one.states.size(); ++k) {
    EXPECT_EQ(one.states[k].values, two.states[k].values);
  }
  const test::Run spheres = test::RunAll(Elongated13(1));
  std::printf(
      "porosity %.4f (spheres %.4f), stress ratio at 2 %% %.2f (%.2f), contacts %.2f (%.2f)\n",
      At(one.states[0], "porosity"), At(spheres.states[0], "porosity"),
      At(one.states[1], "stress_ratio"), At(spheres.states[1], "stress_ratio"),
      At(one.states[0], "coordination_number"), At(spheres.states[0], "coordination_number"));
  EXPECT_NEAR(At(one.states[1], "lateral_stress"), 2e5, 2e2);
  EXPECT_GT(At(one.states[1], "stress_ratio"), 1.3);
  EXPECT_GT(At(one.states[0], "coordination_number"), At(spheres.states[0], "coordination_number"));
}

// Clumps come from packing files too: the text of an elongated packing gives the bits of the
// effect.
TEST(Clump, PackingFilesWithClumpsRun) {
  const auto packing = Elongate(test::SmallPacking(200), 1.3, 1, {});
  ASSERT_TRUE(packing.ok());
  std::vector<PackingProblem> problems;
  Scenario s = Elongated13(1.3);
  s.path = {{.target = 0, .load_step = 0}};
  const test::Run by_effect = test::RunAll(s);
  s.packing = ParsePacking(FormatPacking(*packing), problems);
  ASSERT_TRUE(problems.empty());
  s.model.effects = {};
  s.model.parameters.erase("nonspherical_shape.aspect");
  const test::Run by_file = test::RunAll(s);
  ASSERT_EQ(by_file.states.size(), 1U);
  EXPECT_EQ(by_file.states[0].values, by_effect.states[0].values);
}

/// Two sizes of touching spheres in a bent row, by no symmetry of theirs in their principal axes.
ClumpTemplate Touching() {
  std::vector<PackingProblem> problems;
  ClumpTemplate shape = ParseClumpTemplate("0 0 0 1\n2 0 0 1\n2 1.5 0 0.5\n", problems);
  EXPECT_TRUE(problems.empty());
  return shape;
}

// Touching spheres have closed forms: each its own mass and 2/5 m r^2, the arms by Steiner.
TEST(MakeClumps, KeepsMassInertiaAndPorosity) {
  const Packing& spheres = test::SmallPacking(200);
  const ClumpTemplate shape = Touching();
  const auto made = MakeClumps(spheres, shape, 7, 1, {});
  ASSERT_TRUE(made.ok()) << made.status();
  EXPECT_NEAR(made->porosity, PorosityOf(spheres), 1e-9);
  EXPECT_LT(made->largest_overlap, 2e-2);
  std::printf("largest overlap %.2g of a radius\n", made->largest_overlap);
  const Assembly assembly(made->packing, kDensity, ContactModelOf(test::LinearModel()), 1);
  ASSERT_EQ(assembly.bodies(), 200);
  double mass = 0;
  std::array<double, 3> centre{};
  for (const Sphere& s : shape.spheres) {
    const double m = std::pow(s.radius, 3);  // over 4/3 pi rho R^3, of a sphere of radius R
    mass += m;
    for (std::size_t a = 0; a < 3; ++a) {
      centre[a] += m * s.centre[a];
    }
  }
  EXPECT_NEAR(mass, 1, 1e-9);
  double trace = 0;  // of the inertia over 4/3 pi rho R^5
  for (const Sphere& s : shape.spheres) {
    const double m = std::pow(s.radius, 3);
    double arm2 = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      arm2 += std::pow(s.centre[a] - centre[a], 2);
    }
    trace += 3 * 0.4 * m * s.radius * s.radius + 2 * m * arm2;
  }
  const ParticleArrays& p = assembly.particles();
  double turned = 0;  // mean square of a direction that starts along x
  for (const Clump& clump : assembly.clumps().all()) {
    const auto first = static_cast<std::size_t>(p.id[static_cast<std::size_t>(clump.members[0])]);
    const double r = spheres.radius[static_cast<std::size_t>(made->packing.clump[first])];
    const double sphere = kDensity * 4.0 / 3.0 * std::numbers::pi * r * r * r;
    EXPECT_NEAR(clump.mass, sphere, 1e-9 * sphere);
    EXPECT_NEAR(clump.inertia[0] + clump.inertia[1] + clump.inertia[2], trace * sphere * r * r,
                1e-9 * sphere * r * r);
  }
  for (std::size_t i = 0; i < made->packing.x.size(); i += 3) {  // from the first to the second
    const double dx = made->packing.x[i + 1] - made->packing.x[i];
    const double d = 2 * made->packing.radius[i];
    turned += dx * dx / (d * d) / 200;
    EXPECT_NEAR(std::hypot(dx, made->packing.y[i + 1] - made->packing.y[i],
                           made->packing.z[i + 1] - made->packing.z[i]),
                d, 1e-9 * d);
  }
  EXPECT_NEAR(turned, 1.0 / 3.0, 4 * std::sqrt(4.0 / 45.0 / 200));  // any direction alike
}

TEST(MakeClumps, RunsFromItsFileToTheSameBitsOnAnyNumberOfThreads) {
  const Packing& spheres = test::SmallPacking(60);
  std::vector<PackingProblem> problems;
  const ClumpTemplate corner = ParseClumpTemplate("0 0 0 1\n0.8 0 0 1\n0 0.8 0 0.8\n", problems);
  const auto text = [&](std::uint64_t seed, int threads) {
    const auto made = MakeClumps(spheres, corner, seed, threads, {});
    EXPECT_TRUE(made.ok()) << made.status();
    return made.ok() ? FormatPacking(made->packing) : "";
  };
  const std::string file = text(7, 1);
  EXPECT_EQ(file, text(7, 2));
  EXPECT_NE(file, text(8, 1));
  Scenario s = test::SmallTriaxial(test::LinearModel());
  s.packing = ParsePacking(file, problems);
  ASSERT_TRUE(problems.empty()) << problems[0].message;
  const test::Run run = test::RunAll(s);
  ASSERT_EQ(run.summary.outcome, Outcome::kCompleted) << run.summary.reason;
  EXPECT_NEAR(At(run.states.back(), "lateral_stress"), 2e5, 2e2);
}

TEST(MakeClumps, RefusesWhatCannotBecomeClumps) {
  Packing spheres = test::SmallPacking(60);
  const auto why = [&] {
    return std::string(MakeClumps(spheres, Touching(), 1, 1, {}).status().message());
  };
  spheres.clump[3] = 5;
  EXPECT_THAT(why(), testing::HasSubstr("grain 3 is part of clump 5 already"));
  spheres = test::SmallPacking(60);
  spheres.x[1] = spheres.x[0];
  spheres.y[1] = spheres.y[0];
  spheres.z[1] = spheres.z[0];
  EXPECT_THAT(why(), testing::HasSubstr("grains 0 and 1 overlap by"));
  spheres = Spheres({{0.5, 0.5, 0.5}, {0.2, 0.2, 0.2}}, {-1, -1});
  spheres.length[1] = 5 * kRadius;
  EXPECT_THAT(why(), testing::HasSubstr("must be longer than two of them"));
}

}  // namespace
}  // namespace calib::dem
