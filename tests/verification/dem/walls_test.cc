// Single grains on walls: rolling, sliding, bouncing, conveyors, meshes against the plane they
// stand for.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dem/dynamics/assembly.h"
#include "dem/dynamics/flow.h"
#include "dem/registry/registry.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

constexpr double kRadius = 0.005;
constexpr double kGravity = 9.81;
constexpr double kDensity = 2500;

Model Hard(double friction) {
  Model model;
  model.contact = "hertz_mindlin";
  model.density = kDensity;
  model.parameters = {
      {"young_modulus", 1e9}, {"poisson_ratio", 0.25}, {"friction_coefficient", friction}};
  return model;
}

Model With(Model model, const std::string& effect, std::map<std::string, double> parameters) {
  model.effects.push_back(effect);
  for (const auto& [name, value] : parameters) {
    model.parameters[effect + "." + name] = value;
  }
  return model;
}

/// One grain at a place in a box of 100 radii.
Packing OneGrain(const Vec3& at) {
  Packing packing;
  packing.length[0] = packing.length[1] = packing.length[2] = 100 * kRadius;
  packing.x = {at.x};
  packing.y = {at.y};
  packing.z = {at.z};
  packing.radius = {kRadius};
  packing.clump = {-1};
  return packing;
}

Wall Floor() { return MakePlane("floor", {0, 0, 0}, {0, 0, 1}); }

/// The floor as a fan of thin triangles about (x, y), so that edges and a corner lie below it.
Wall FanFloor(double x, double y) {
  TriangleMesh mesh;
  constexpr int kBlades = 7;
  for (int k = 0; k < kBlades; ++k) {
    const auto rim = [&](int i) {
      const double angle = 2 * std::numbers::pi * i / kBlades;
      return Vec3{x + std::cos(angle), y + std::sin(angle), 0};
    };
    mesh.vertex.insert(mesh.vertex.end(), {{x, y, 0}, rim(k), rim(k + 1)});
    mesh.triangle.push_back({3 * k, 3 * k + 1, 3 * k + 2});
  }
  return MakeMeshWall("floor", mesh);
}

/// Floor of squares much smaller than the grain.
Wall TiledFloor(double tile) {
  TriangleMesh mesh;
  for (int i = -20; i < 40; ++i) {
    for (int j = -6; j < 6; ++j) {
      AddQuad({i * tile, j * tile, 0}, {(i + 1) * tile, j * tile, 0},
              {(i + 1) * tile, (j + 1) * tile, 0}, {i * tile, (j + 1) * tile, 0}, mesh);
    }
  }
  return MakeMeshWall("floor", mesh);
}

struct Ball {
  Assembly assembly;
  double dt = 0;

  Ball(const Model& model, const Vec3& at, Surroundings surroundings)
      : assembly(OneGrain(at), model.density, ContactModelOf(model), std::move(surroundings), 1),
        dt(0.1 * assembly.NominalCriticalStep()) {
    EXPECT_TRUE(assembly.EvaluateForces().ok());
  }
  void Advance(double duration) {
    const auto steps = static_cast<int>(std::lround(duration / dt));
    for (int k = 0; k < steps; ++k) {
      assembly.Move({.dt = dt});
      ASSERT_TRUE(assembly.EvaluateForces().ok());
    }
  }
  ParticleArrays& grain() { return assembly.mutable_particles(); }
};

/// Overlap at which a grain rests on a plane under its weight times share [m].
double RestingOverlap(double share) {
  const double kn = 2e9 / (3 * (1 - 0.25 * 0.25)) * std::sqrt(kRadius);  // F = kn u^1.5
  const double weight =
      share * kDensity * 4.0 / 3.0 * std::numbers::pi * kRadius * kRadius * kRadius * kGravity;
  return std::pow(weight / kn, 2.0 / 3.0);
}

/// Down an incline of angle alpha: gravity is turned, the floor is level, x points downhill.
Surroundings Incline(double alpha, Wall floor) {
  return {.gravity = {kGravity * std::sin(alpha), 0, -kGravity * std::cos(alpha)},
          .walls = {std::move(floor)}};
}

double SpeedDown(double alpha, const Model& model, Wall floor, double duration) {
  Ball run(model, {0, 0.0003, kRadius - RestingOverlap(std::cos(alpha))},
           Incline(alpha, std::move(floor)));
  run.Advance(duration);
  return run.grain().vx[0];
}

TEST(Incline, GrainRollsWithFiveSeventhsOfGravity) {
  const double alpha = 0.3;  // tan = 0.31 < 7/2 mu
  const double expected = 5.0 / 7.0 * kGravity * std::sin(alpha) * 0.05;
  EXPECT_NEAR(SpeedDown(alpha, Hard(0.4), Floor(), 0.05), expected, 2e-3 * expected);
}

TEST(Incline, DiskRollsWithTwoThirdsOfGravity) {
  const double alpha = 0.3;  // tan = 0.31 < 3 mu
  const double thickness = 2 * kRadius;
  const double heavier = 0.75 * thickness / kRadius;  // than a sphere of its radius
  Surroundings slope = Incline(alpha, Floor());
  slope.planar = true;
  slope.thickness = thickness;
  Ball run(Hard(0.4), {0, 0, kRadius - RestingOverlap(heavier * std::cos(alpha))}, slope);
  run.Advance(0.05);
  const double expected = 2.0 / 3.0 * kGravity * std::sin(alpha) * 0.05;
  EXPECT_NEAR(run.grain().vx[0], expected, 2e-3 * expected);
}

TEST(Incline, GrainSlidesWhereItCannotRoll) {
  const double alpha = 1.0;
  const double mu = 0.2;  // tan(alpha) = 1.56 > 7/2 mu
  const double expected = kGravity * (std::sin(alpha) - mu * std::cos(alpha)) * 0.05;
  EXPECT_NEAR(SpeedDown(alpha, Hard(mu), Floor(), 0.05), expected, 2e-3 * expected);
}

TEST(Incline, WallFrictionReplacesThatBetweenGrains) {
  const double alpha = 1.0;
  const double expected = kGravity * (std::sin(alpha) - 0.1 * std::cos(alpha)) * 0.05;
  EXPECT_NEAR(SpeedDown(alpha, With(Hard(0.2), "wall_friction", {{"ratio", 0.5}}), Floor(), 0.05),
              expected, 2e-3 * expected);
  EXPECT_NEAR(
      SpeedDown(alpha, With(Hard(0.7), "wall_friction", {{"coefficient", 0.1}}), Floor(), 0.05),
      expected, 2e-3 * expected);
  EXPECT_EQ(SpeedDown(alpha, With(Hard(0.2), "wall_friction", {{"ratio", 1}}), Floor(), 0.01),
            SpeedDown(alpha, Hard(0.2), Floor(), 0.01));
}

TEST(Incline, RollingFrictionHoldsTheGrain) {
  // Bending moments bear up to eta r Fn, the slope asks for r Fn tan(alpha).
  const auto rolling = [](double eta) {
    return With(Hard(0.5), "rolling_resistance", {{"stiffness_ratio", 1.0}, {"friction", eta}});
  };
  const double free = 5.0 / 7.0 * kGravity * std::sin(0.1) * 0.1;
  EXPECT_LT(std::abs(SpeedDown(0.1, rolling(0.2), Floor(), 0.1)), 2e-2 * free);
  const double driven = 5.0 / 7.0 * kGravity * (std::sin(0.1) - 0.05 * std::cos(0.1)) * 0.1;
  EXPECT_NEAR(SpeedDown(0.1, rolling(0.05), Floor(), 0.1), driven, 2e-2 * driven);
}

TEST(MeshWall, EdgesAndCornersOfAFlatMeshAreNotFelt) {
  const double alpha = 0.3;
  const double plane = SpeedDown(alpha, Hard(0.4), Floor(), 0.05);
  EXPECT_NEAR(SpeedDown(alpha, Hard(0.4), TiledFloor(0.0011), 0.05), plane, 1e-6 * plane);
  EXPECT_NEAR(SpeedDown(alpha, Hard(0.4), FanFloor(0.002, 0.0003), 0.05), plane, 1e-6 * plane);
}

TEST(MeshWall, AGrainAboveACornerHasOneContact) {
  for (const double offset : {0.0, 1e-12, 1e-9, 1e-5}) {
    Ball run(Hard(0.4), {offset, 0, kRadius - 1e-6},
             {.gravity = {0, 0, -kGravity}, .walls = {FanFloor(0, 0)}});
    EXPECT_EQ(run.assembly.walls().contacts(), 1) << offset;
  }
}

TEST(MeshWall, AGrainInAValleyTouchesBothSidesAndOnARidgeTheEdge) {
  const auto roof = [](double slope) {  // along y, the crease at x = 0
    TriangleMesh mesh;
    AddQuad({0, -1, 0}, {1, -1, slope}, {1, 1, slope}, {0, 1, 0}, mesh);
    AddQuad({0, -1, 0}, {0, 1, 0}, {-1, 1, slope}, {-1, -1, slope}, mesh);
    return MakeMeshWall("roof", mesh);
  };
  const double u = 1e-6;
  Ball valley(Hard(0.4), {0, 0, (kRadius - u) * std::sqrt(2)}, {.walls = {roof(1)}});
  EXPECT_EQ(valley.assembly.walls().contacts(), 2);
  Ball ridge(Hard(0.4), {0, 0, kRadius - u}, {.walls = {roof(-1)}});
  EXPECT_EQ(ridge.assembly.walls().contacts(), 1);
  EXPECT_GT(-ridge.assembly.walls().ForceOn(0).z, 0);
}

TEST(Bounce, ElasticGrainReachesItsHeightAgain) {
  const double height = 0.02;
  Ball run(Hard(0.4), {0, 0, kRadius + height}, {.gravity = {0, 0, -kGravity}, .walls = {Floor()}});
  const double fall = std::sqrt(2 * height / kGravity);
  double highest = 0;
  run.Advance(1.2 * fall);
  for (int k = 0; k < 80; ++k) {
    run.Advance(fall / 50);
    highest = std::max(highest, run.grain().z[0] - kRadius);
  }
  EXPECT_NEAR(highest, height, 2e-3 * height);
}

TEST(Bounce, RestitutionOfViscousDampingIsThatOfTheGrainsMass) {
  // At equal damping ratio and Hertz stiffness restitution depends on the ratio alone, so that a
  // wall gives what two grains give; with half the mass it would be higher.
  const Model model = With(Hard(0.4), "viscous_damping", {{"ratio", 0.2}});
  Ball wall(model, {0, 0, kRadius + 1e-5}, {.walls = {Floor()}});
  wall.grain().vz[0] = -0.5;
  wall.Advance(2e-4);
  const double n[3] = {0, 0, 1};
  Assembly pair(test::TwoSpheres(kRadius, 2 * kRadius + 1e-5, n), kDensity, ContactModelOf(model),
                1);
  ASSERT_TRUE(pair.EvaluateForces().ok());
  ParticleArrays& p = pair.mutable_particles();
  const std::size_t low = p.z[0] < p.z[1] ? 0 : 1;
  p.vz[low] = 0.25;
  p.vz[1 - low] = -0.25;
  for (int k = 0; k < static_cast<int>(2e-4 / wall.dt); ++k) {
    pair.Move({.dt = wall.dt});
    ASSERT_TRUE(pair.EvaluateForces().ok());
  }
  const double of_pair = (p.vz[1 - low] - p.vz[low]) / 0.5;
  EXPECT_GT(wall.grain().vz[0], 0.2);
  EXPECT_NEAR(wall.grain().vz[0] / 0.5, of_pair, 1e-2);  // steps per contact differ
}

/// Largest gap at which a grain that has touched the floor still pulls on it, when it is lifted in
/// steps.
double GapAtWall(const Model& model, double step) {
  Ball run(model, {0, 0, kRadius - step}, {.walls = {Floor()}});
  const auto pulls = [&run] {
    EXPECT_TRUE(run.assembly.EvaluateForces().ok());
    return run.assembly.walls().ForceOn(0).z != 0;
  };
  double gap = -step;
  while (pulls()) {
    gap += step;
    run.grain().z[0] += step;
    run.assembly.SearchAgain();
  }
  return gap - step;
}

// R* = r and R = 2 r at a wall, twice those of two such grains.
TEST(Wall, AdhesionAndBridgesHoldToTheirGapThere) {
  constexpr double kWork = 2;
  const double modulus = 1e9 / (2 * (1 - 0.25 * 0.25));
  const double smallest = std::cbrt(std::numbers::pi * kWork * kRadius * kRadius / (8 * modulus));
  const double breaking = 3 * smallest * smallest / kRadius;
  EXPECT_NEAR(
      GapAtWall(With(Hard(0.4), "adhesion_jkr", {{"work_of_adhesion", kWork}}), 1e-3 * breaking),
      breaking, 2e-3 * breaking);
  const double rupture = std::cbrt(1e-3) * 2 * kRadius;
  EXPECT_NEAR(GapAtWall(With(Hard(0.4), "capillary_bridges",
                             {{"surface_tension", 0.073}, {"volume_ratio", 1e-3}}),
                        1e-3 * rupture),
              rupture, 2e-3 * rupture);
}

// Unloading is stiffer than anything that an empty memory shows.
TEST(Flow, StepIsThatOfUnloadingPlasticContacts) {
  const auto step = [](const Model& model) {
    Ball run(model, {0, 0, kRadius + 1e-3}, {.gravity = {0, 0, -kGravity}, .walls = {Floor()}});
    const Flow flow(run.assembly, {.drop_height = 0.1}, {});
    return flow.time_step();
  };
  const double plain = step(Hard(0.4));
  EXPECT_EQ(step(With(Hard(0.4), "contact_plasticity", {{"stiffness_ratio", 1}})), plain);
  EXPECT_NEAR(step(With(Hard(0.4), "contact_plasticity", {{"stiffness_ratio", 16}})), plain / 4,
              1e-9 * plain);
}

TEST(Conveyor, BeltCarriesAGrainToItsSpeed) {
  // Sliding until v = V(1 - 2/7): a sphere dropped without spin ends rolling on the belt.
  Wall belt = Floor();
  belt.surface_velocity = {0.5, 0, 0};
  Ball run(Hard(0.4), {0, 0, kRadius - RestingOverlap(1)},
           {.gravity = {0, 0, -kGravity}, .walls = {belt}});
  run.Advance(0.02);
  EXPECT_NEAR(run.grain().vx[0], 0.4 * kGravity * 0.02, 2e-3);
  run.Advance(0.1);
  const double v = 0.5 * 2.0 / 7.0;
  EXPECT_NEAR(run.grain().vx[0], v, 2e-3 * v);
}

TEST(MovingWall, TurningMeshKeepsItsShapeAndSpeed) {
  TriangleMesh mesh;
  AddFrustum({.centre = {0, 0, 0}, .height = 0.1, .lower_radius = 0.2, .upper_radius = 0.2}, mesh);
  Wall drum = MakeMeshWall("drum", mesh);
  drum.angular_velocity = {0, 0, 2.0};
  for (int k = 0; k < 100'000; ++k) {
    drum.Move(1e-4);
  }
  const Vec3& v = drum.mesh.vertex[0];
  EXPECT_NEAR(std::hypot(v.x, v.y), 0.2, 1e-10);
  EXPECT_NEAR(v.x, 0.2 * std::cos(20.0), 1e-6);
  EXPECT_NEAR(v.y, 0.2 * std::sin(20.0), 1e-6);
}

TEST(MovingWall, LiftedFloorCarriesTheGrain) {
  Wall floor = Floor();
  floor.velocity = {0, 0, 0.05};
  Ball run(With(Hard(0.4), "viscous_damping", {{"ratio", 0.5}}),
           {0, 0, kRadius - RestingOverlap(1)}, {.gravity = {0, 0, -kGravity}, .walls = {floor}});
  run.Advance(0.1);
  EXPECT_NEAR(run.grain().vz[0], 0.05, 1e-4);
  EXPECT_NEAR(run.grain().z[0], kRadius + 0.005, 1e-5);
}

TEST(Membership, RemovedGrainsLeaveTheMemoryOfOthersAlone) {
  // Three grains in a row on the floor, pressed together; taking the far one out changes nothing
  // between the other two until its absence is felt.
  Packing packing = OneGrain({0.1, 0.1, kRadius - 1e-6});
  for (const double x : {0.1 + 2 * kRadius - 1e-6, 0.3}) {
    packing.x.push_back(x);
    packing.y.push_back(0.1);
    packing.z.push_back(kRadius - 1e-6);
    packing.radius.push_back(kRadius);
    packing.clump.push_back(-1);
  }
  const Model model = Hard(0.5);
  const Surroundings between{.gravity = {0, 0, -kGravity}, .walls = {Floor()}};
  Assembly with(packing, kDensity, ContactModelOf(model), between, 1);
  ASSERT_TRUE(with.EvaluateForces().ok());
  const double dt = 0.1 * with.NominalCriticalStep();
  with.mutable_particles().vy[0] = 0.01;
  const auto go = [&](Assembly& a, int steps) {
    for (int k = 0; k < steps; ++k) {
      a.Move({.dt = dt});
      ASSERT_TRUE(a.EvaluateForces().ok());
    }
  };
  go(with, 50);
  Assembly without = with;
  int far = -1;
  for (int g = 0; g < 3; ++g) {
    far = with.particles().x[static_cast<std::size_t>(g)] > 0.2 ? g : far;
  }
  without.Remove({far});
  ASSERT_TRUE(without.EvaluateForces().ok());
  Assembly same = with;
  ASSERT_TRUE(same.EvaluateForces().ok());  // both have evaluated once more without moving
  go(same, 50);
  go(without, 50);
  ASSERT_EQ(without.particles().size(), 2);
  for (std::size_t g = 0, k = 0; g < 3; ++g) {
    if (static_cast<int>(g) == far) continue;
    EXPECT_EQ(without.particles().vy[k], same.particles().vy[g]);
    EXPECT_EQ(without.particles().id[k], same.particles().id[g]);
    ++k;
  }
}

/// Grains that pour through a turning funnel onto a floor.
class Pouring {
 public:
  Pouring()
      : assembly_(Make()),
        flow_(assembly_, {.drop_height = 0.3, .low = {-1, -1, -1}, .high = {2, 2, 2}}, {}) {
    flow_.SetDrain(0.004);
  }
  Flow& flow() { return flow_; }

 private:
  static Assembly Make() {
    Packing grains;
    for (int k = 0; k < 60; ++k) {
      grains.x.push_back(0.25 + 0.011 * (k % 4 - 1.5));
      grains.y.push_back(0.25 + 0.011 * (k / 4 % 4 - 1.5));
      grains.z.push_back(0.15 + 0.011 * (k / 16));
      grains.radius.push_back(kRadius);
      grains.clump.push_back(-1);
    }
    grains.length[0] = grains.length[1] = grains.length[2] = 0.5;
    TriangleMesh mesh;
    AddFrustum(
        {.centre = {0.25, 0.25, 0.08}, .height = 0.2, .lower_radius = 0.012, .upper_radius = 0.08},
        mesh);
    Wall funnel = MakeMeshWall("funnel", mesh);
    funnel.centre = {0.25, 0.25, 0};
    funnel.angular_velocity = {0, 0, 3};
    Model model = With(Hard(0.3), "viscous_damping", {{"ratio", 0.3}});
    model.parameters["young_modulus"] = 5e6;
    return {grains,
            kDensity,
            ContactModelOf(model),
            {.gravity = {0, 0, -kGravity}, .walls = {Floor(), funnel}},
            1};
  }

  Assembly assembly_;
  Flow flow_;
};

TEST(Checkpoint, AFlowGoesOnFromItBitForBit) {
  Pouring whole;
  ASSERT_EQ(whole.flow().Advance(0.1), StageEnd::kDone) << whole.flow().reason();
  const std::string bytes = whole.flow().Checkpoint();
  ASSERT_EQ(whole.flow().Advance(0.1), StageEnd::kDone) << whole.flow().reason();
  Pouring resumed;
  ASSERT_TRUE(resumed.flow().Restore(bytes).ok());
  ASSERT_EQ(resumed.flow().Advance(0.1), StageEnd::kDone);
  const ParticleArrays& a = whole.flow().assembly().particles();
  const ParticleArrays& b = resumed.flow().assembly().particles();
  EXPECT_GT(whole.flow().assembly().walls().contacts(), 0);
  EXPECT_EQ(whole.flow().time(), resumed.flow().time());
  EXPECT_EQ(whole.flow().drained().size(), resumed.flow().drained().size());
  EXPECT_EQ(a.id, b.id);
  EXPECT_EQ(a.x, b.x);
  EXPECT_EQ(a.z, b.z);
  EXPECT_EQ(a.wy, b.wy);
}

TEST(Checkpoint, BytesThatAreNoneAreRefusedAndChangeNothing) {
  Pouring pouring;
  ASSERT_EQ(pouring.flow().Advance(0.01), StageEnd::kDone);
  const std::string bytes = pouring.flow().Checkpoint();
  const double time = pouring.flow().time();
  EXPECT_FALSE(pouring.flow().Restore("").ok());
  EXPECT_FALSE(pouring.flow().Restore(std::string(1000, 'x')).ok());
  EXPECT_FALSE(pouring.flow().Restore(bytes.substr(0, bytes.size() / 2)).ok());
  EXPECT_FALSE(pouring.flow().Restore(bytes + "x").ok());
  EXPECT_EQ(pouring.flow().time(), time);
  EXPECT_EQ(pouring.flow().Checkpoint().size(), bytes.size());
}

TEST(Energy, OfAGrainThatRollsAndBouncesInABoxIsKept) {
  Surroundings box{.gravity = {0, 0, -kGravity}};
  TriangleMesh mesh;
  AddFrustum({.centre = {0.25, 0.25, 0}, .height = 0.5, .lower_radius = 0.05, .upper_radius = 0.05},
             mesh);
  box.walls = {Floor(), MakeMeshWall("tube", mesh)};
  Ball run(Hard(0), {0.25, 0.26, 0.05}, box);
  run.grain().vx[0] = 0.3;
  run.grain().vy[0] = 0.1;
  const auto energy = [&] {
    const ParticleArrays& p = run.grain();
    return 0.5 * (p.vx[0] * p.vx[0] + p.vy[0] * p.vy[0] + p.vz[0] * p.vz[0]) + kGravity * p.z[0];
  };
  const double before = energy();
  run.Advance(1.0);
  EXPECT_NEAR(energy(), before, 5e-3 * before);
}

}  // namespace
}  // namespace calib::dem
