// Grains under gravity: the speed of their flow out of a silo of grains in a plane and a hopper of
// triangles; and, for another code to go on from, a hopper that empties, a drum that turns and a
// cylinder that is lifted.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <map>
#include <numbers>
#include <string>
#include <utility>

#include "dem/dynamics/flow.h"
#include "dem/particles/loose_fill.h"
#include "dem/registry/registry.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

constexpr double kDiameter = 0.002;
constexpr double kGravity = 9.81;
constexpr double kFilling = 0.1;            // s, at most, to come to rest
constexpr double kFlowing = 0.02;           // s, from the opening to the first step that is timed
constexpr double kDrain = -10 * kDiameter;  // m, where grains are taken out
constexpr int kSides = 32;
constexpr int kSteps = 1000;  // timed; the vessels are far from empty after them

/// Hertz-Mindlin with a dashpot, as deploy/bench/peers gives it to LIGGGHTS.
Model Beads() {
  Model model;
  model.contact = "hertz_mindlin";
  model.density = 2500;
  model.effects = {"viscous_damping"};
  model.parameters = {{"young_modulus", 1e7},
                      {"poisson_ratio", 0.25},
                      {"friction_coefficient", 0.5},
                      {"viscous_damping.ratio", 0.2}};
  return model;
}

/// Grains above a plane floor, walls whose outlet is open.
struct Vessel {
  Packing grains{};
  TriangleMesh walls{};
  bool planar = false;
};

/// 64 diameters wide and filled with 16 000 grains [Hadjidoukas 2014, sec. 5.3], or as slender with
/// fewer; an outlet of eight diameters.
Vessel Silo(int grains, int seed) {
  const double d = kDiameter;
  const double width = 64 * d * std::sqrt(grains / 16'000.0);
  const double m = 0.5 * width + d;
  Vessel vessel{.planar = true};
  vessel.grains = LooseFill(
      std::vector<double>(static_cast<std::size_t>(grains), 0.5 * d),
      {.low = {d, m, 0},
       .width = width,
       .holds = [&](const Vec3& c, double r) { return std::abs(c.x - m) + r < 0.5 * width; }},
      seed);
  const double top = TopOf(vessel.grains) + d;
  const double depth = 0.5 * width;
  const auto plate = [&](double x1, double z1, double x2, double z2) {
    AddQuad({x1, m - depth, z1}, {x2, m - depth, z2}, {x2, m + depth, z2}, {x1, m + depth, z1},
            vessel.walls);
  };
  plate(d, 0, m - 4 * d, 0);
  plate(m + 4 * d, 0, d + width, 0);
  plate(d, 0, d, top);
  plate(d + width, 0, d + width, top);
  return vessel;
}

/// A cone of 30 degrees about the vertical below a cylinder, 128 triangles of which grains touch
/// most.
Vessel Hopper(int grains, int seed) {
  const double d = kDiameter;
  const double outlet = 4 * d;
  const double radius = 0.75 * d * std::cbrt(grains);
  const double cone = (radius - outlet) * std::sqrt(3.0);
  const double m = radius + d;
  const double flat = std::cos(std::numbers::pi / kSides);
  Vessel vessel;
  vessel.grains = LooseFill(std::vector<double>(static_cast<std::size_t>(grains), 0.5 * d),
                            {.low = {d, d, 0},
                             .width = 2 * radius,
                             .depth = 2 * radius,
                             .holds =
                                 [&](const Vec3& c, double r) {
                                   const double here =
                                       outlet + std::min(c.z / cone, 1.0) * (radius - outlet);
                                   return std::hypot(c.x - m, c.y - m) + 1.2 * r < flat * here;
                                 }},
                            seed);
  AddFrustum({.centre = {m, m, 0},
              .height = cone,
              .lower_radius = outlet,
              .upper_radius = radius,
              .sides = kSides},
             vessel.walls);
  AddFrustum({.centre = {m, m, cone},
              .height = TopOf(vessel.grains),
              .lower_radius = radius,
              .upper_radius = radius,
              .sides = kSides},
             vessel.walls);
  return vessel;
}

/// What another code needs to go on from here, flow.txt with the time step, the box and one grain
/// per line: x y z r vx vy vz (SI).
void WriteState(const std::string& folder, const Flow& flow, const Vec3& box) {
  const ParticleArrays& p = flow.assembly().particles();
  std::ofstream grains(folder + "/flow.txt");
  grains.precision(std::numeric_limits<double>::max_digits10);
  grains << flow.time_step() << ' ' << box.x << ' ' << box.y << ' ' << box.z << '\n';
  for (std::size_t g = 0; g < p.x.size(); ++g) {
    grains << p.x[g] << ' ' << p.y[g] << ' ' << p.z[g] << ' ' << p.radius[g] << ' ' << p.vx[g]
           << ' ' << p.vy[g] << ' ' << p.vz[g] << '\n';
  }
}

void WriteMesh(const std::string& path, const TriangleMesh& mesh) {
  std::ofstream stl(path);
  stl.precision(std::numeric_limits<double>::max_digits10);
  stl << "solid mesh\n";
  for (const auto& corners : mesh.triangle) {
    stl << "facet normal 0 0 0\nouter loop\n";
    for (const int corner : corners) {
      const Vec3& v = mesh.vertex[static_cast<std::size_t>(corner)];
      stl << "vertex " << v.x << ' ' << v.y << ' ' << v.z << '\n';
    }
    stl << "endloop\nendfacet\n";
  }
  stl << "endsolid mesh\n";
}

/// Flowing out of a vessel that was filled on a plane floor.
struct Flowing {
  Assembly assembly;
  FlowOptions options{};
  std::string failure{};  ///< empty: none
};

Flowing FillAndOpen(Vessel vessel) {
  const Model model = Beads();
  const double top = TopOf(vessel.grains);
  const Bounds bounds = BoundsOf(vessel.walls);
  vessel.grains.length[0] = bounds.high.x + kDiameter;
  vessel.grains.length[1] = vessel.planar ? kDiameter : bounds.high.y + kDiameter;
  vessel.grains.length[2] = top;
  Flowing flowing{.assembly = Assembly(vessel.grains, model.density, ContactModelOf(model),
                                       {.gravity = {0, 0, -kGravity},
                                        .walls = {MakePlane("floor", {0, 0, 0}, {0, 0, 1}),
                                                  MakeMeshWall("vessel", vessel.walls)},
                                        .planar = vessel.planar},
                                       1),
                  .options = {.drop_height = top, .low = {-1, -1, -1}, .high = {10, 10, 10 * top}}};
  Flow flow(flowing.assembly, flowing.options, {});
  if (flow.Settle(kFilling, 0.3) == StageEnd::kDone) {
    flowing.assembly.mutable_walls()[0].active = false;
    flowing.assembly.SearchAgain();
    flow.SetDrain(kDrain);
    flow.Advance(kFlowing);
  }
  flowing.failure = flow.reason();
  if (const char* folder = std::getenv("CALIB_BENCH_STATE"); folder != nullptr) {
    WriteState(folder, flow, {bounds.high.x + kDiameter, bounds.high.y + kDiameter, bounds.high.z});
    WriteMesh(std::string(folder) + "/vessel.stl", vessel.walls);
  }
  return flowing;
}

/// Every iteration is one step of the flow.
void Discharge(benchmark::State& state, Vessel (*make)(int, int)) {
  // The library calls a benchmark several times; filling takes longer than what is timed.
  static std::map<std::pair<Vessel (*)(int, int), int>, Flowing> all;
  const auto grains = static_cast<int>(state.range(0));
  const auto key = std::pair(make, grains);
  if (!all.contains(key)) {
    all.emplace(key, FillAndOpen(make(grains, 1)));
  }
  const Flowing& flowing = all.at(key);
  if (!flowing.failure.empty()) {
    state.SkipWithError(flowing.failure.c_str());
    return;
  }
  Assembly assembly = flowing.assembly;
  Flow flow(assembly, flowing.options, {});
  flow.SetDrain(kDrain);
  const std::int64_t steps = assembly.steps();
  const std::int64_t updates = assembly.contact_updates();
  std::int64_t particle_steps = 0;
  while (state.KeepRunning()) {
    particle_steps += assembly.particles().size();
    if (flow.Advance(0.5 * flow.time_step()) != StageEnd::kDone) {
      state.SkipWithError(flow.reason().c_str());
      return;
    }
  }
  const auto rate = [](std::int64_t count) {
    return benchmark::Counter(static_cast<double>(count), benchmark::Counter::kIsRate);
  };
  state.counters["particle_steps/s"] = rate(particle_steps);
  state.counters["contact_updates/s"] = rate(assembly.contact_updates() - updates);
  state.counters["steps/s"] = rate(assembly.steps() - steps);
}

/// What is left of the grains in a vessel until a third is: in $CALIB_BENCH_STATE left.txt, a line
/// per kEvery with the time [s] and the number of grains above the drain. deploy/bench/peers lets
/// another code go on from the same state.
void Emptying(benchmark::State& state, Vessel (*make)(int, int)) {
  constexpr double kEvery = 2e-3;  // s
  constexpr double kLongest = 10;  // s
  const auto grains = static_cast<int>(state.range(0));
  while (state.KeepRunning()) {
    Flowing flowing = FillAndOpen(make(grains, static_cast<int>(state.range(1))));
    Flow flow(flowing.assembly, flowing.options, {});
    flow.SetDrain(kDrain);
    std::ofstream left;
    if (const char* folder = std::getenv("CALIB_BENCH_STATE"); folder != nullptr) {
      left.open(std::string(folder) + "/left.txt");
    }
    int still = flowing.assembly.particles().size();
    const int first = still;
    StageEnd end = flowing.failure.empty() ? StageEnd::kDone : StageEnd::kDiverged;
    while (end == StageEnd::kDone && 3 * still > first && flow.time() < kLongest) {
      left << flow.time() << ' ' << still << '\n';
      end = flow.Advance(kEvery);
      still = flowing.assembly.particles().size();
    }
    if (end != StageEnd::kDone) {
      state.SkipWithError((flowing.failure + flow.reason()).c_str());
      return;
    }
    state.counters["seconds"] = flow.time();
    state.counters["left"] = still;
  }
}

/// Grains whose container, the last of the walls, moves once they rest.
struct Container {
  Packing grains{};
  Surroundings around{};
  Vec3 velocity{}, angular_velocity{};
  Vec3 box{};        ///< that everything stays in [m]
  double moves = 0;  ///< [s]
};

/// Within a tenth of the mean, so that they form no crystal.
std::vector<double> Graded(int grains) {
  std::vector<double> radii;
  for (int g = 0; g < grains; ++g) {
    radii.push_back(0.5 * kDiameter * (0.9 + 0.2 * (g + 0.5) / grains));
  }
  return radii;
}

/// A quarter full, of 48 sides and periodic along its axis, as the test `rotating_drum` has it.
Container Drum(int grains, int seed) {
  constexpr int kDrumSides = 48;
  constexpr double kSpeed = 4;    // rad/s
  constexpr double kMoves = 1.6;  // s, a turn
  const double d = kDiameter;
  const double radius = 14 * d * std::sqrt(grains / 1000.0);
  const double length = 6 * d;
  const double m = radius + 2 * d;
  const double inner = radius * std::cos(std::numbers::pi / kDrumSides);
  Container drum{.around = {.open = {true, false, true}},
                 .angular_velocity = {0, -kSpeed, 0},
                 .moves = kMoves};
  drum.grains = LooseFill(
      Graded(grains),
      {.low = {m - radius, 0, m - radius},
       .width = 2 * radius,
       .depth = length,
       .height = 2 * radius,
       .holds = [&](const Vec3& c, double r) { return std::hypot(c.x - m, c.z - m) + r < inner; },
       .repeats = true},
      seed);
  TriangleMesh side;
  AddFrustumAlongY({.centre = {m, -d, m},
                    .height = length + 2 * d,
                    .lower_radius = radius,
                    .upper_radius = radius,
                    .sides = kDrumSides},
                   side);
  drum.around.walls = {MakeMeshWall("drum", side)};
  drum.around.walls.back().centre = {m, 0, m};
  drum.box = {2 * m, length, 2 * m};
  return drum;
}

/// A cylinder about as wide as its filling is high, as the test `angle_of_repose` has it, on a
/// floor with a rim of one diameter: grains that roll without resistance make no heap without.
Container Cylinder(int grains, int seed) {
  const double d = kDiameter;
  const double radius = 5.25 * d * std::cbrt(grains / 1000.0);
  const double rim = 10 * d * std::cbrt(grains / 1000.0);
  const double m = 20 * radius;
  const double inner = radius * std::cos(std::numbers::pi / kSides);
  const double speed = 0.15 * std::sqrt(kGravity * d);
  Container cylinder{.velocity = {0, 0, speed}, .moves = (2 * radius + 3 * d) / speed};
  cylinder.grains = LooseFill(
      Graded(grains),
      {.low = {m - radius, m - radius, 0},
       .width = 2 * radius,
       .depth = 2 * radius,
       .holds = [&](const Vec3& c, double r) { return std::hypot(c.x - m, c.y - m) + r < inner; }},
      seed);
  const double top = TopOf(cylinder.grains) + d;
  const auto side = [&](double height, double wide) {
    TriangleMesh mesh;
    AddFrustum({.centre = {m, m, 0},
                .height = height,
                .lower_radius = wide,
                .upper_radius = wide,
                .sides = kSides},
               mesh);
    return mesh;
  };
  cylinder.around.walls = {MakePlane("floor", {0, 0, 0}, {0, 0, 1}),
                           MakeMeshWall("rim", side(d, rim)),
                           MakeMeshWall("cylinder", side(top, radius))};
  cylinder.around.walls.back().centre = {m, m, 0};
  cylinder.box = {2 * m, 2 * m, top + speed * cylinder.moves + d};
  return cylinder;
}

/// A container that is filled and, once the grains rest, moves: in $CALIB_BENCH_STATE their state;
/// the walls' meshes, NAME.stl; motion.txt, a line of the container's centre, velocity and angular
/// velocity, the time before it moves, the time between frames and their number; and frames.txt,
/// x y z r of the grains at those times, headed as in LIGGGHTS' dumps (SI). deploy/bench/peers lets
/// another code go on from the same state, in which all are at rest and no contact remembers
/// anything.
void Moving(benchmark::State& state, Container (*make)(int, int)) {
  constexpr double kRest = 0.05;   // s, before it moves
  constexpr double kEvery = 0.01;  // s
  constexpr double kLongest = 3;   // s, of filling
  const Model model = Beads();
  const char* const folder = std::getenv("CALIB_BENCH_STATE");
  while (state.KeepRunning()) {
    Container container = make(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)));
    const double top = TopOf(container.grains);
    container.grains.length[0] = container.box.x;
    container.grains.length[1] = container.box.y;
    container.grains.length[2] = container.box.z;
    container.around.gravity = {0, 0, -kGravity};
    const FlowOptions options{.drop_height = top, .low = {-1, -1e300, -1}, .high = {10, 1e300, 10}};
    Packing& grains = container.grains;
    {
      Assembly filling(grains, model.density, ContactModelOf(model), container.around, 1);
      Flow flow(filling, options, {});
      if (flow.Settle(kLongest, 0.3) != StageEnd::kDone) {
        state.SkipWithError(flow.reason().c_str());
        return;
      }
      const ParticleArrays& p = filling.particles();
      grains.x.assign(p.x.begin(), p.x.end());
      grains.y.assign(p.y.begin(), p.y.end());
      grains.z.assign(p.z.begin(), p.z.end());
      grains.radius.assign(p.radius.begin(), p.radius.end());
    }
    Assembly assembly(grains, model.density, ContactModelOf(model), container.around, 1);
    Flow flow(assembly, options, {});
    const int frames = static_cast<int>(container.moves / kEvery);
    std::ofstream out;
    Wall& wall = assembly.mutable_walls().back();
    if (folder != nullptr) {
      WriteState(folder, flow, container.box);
      for (const Wall& each : assembly.walls().walls()) {
        if (!each.IsPlane()) {
          WriteMesh(std::string(folder) + "/" + each.name + ".stl", each.mesh);
        }
      }
      std::ofstream motion(std::string(folder) + "/motion.txt");
      for (const Vec3& v : {wall.centre, container.velocity, container.angular_velocity}) {
        motion << v.x << ' ' << v.y << ' ' << v.z << ' ';
      }
      motion << kRest << ' ' << kEvery << ' ' << frames << '\n';
      out.open(std::string(folder) + "/frames.txt");
    }
    StageEnd end = flow.Advance(kRest);
    wall.velocity = container.velocity;
    wall.angular_velocity = container.angular_velocity;
    const double start = flow.time();
    for (int frame = 1; frame <= frames && end == StageEnd::kDone; ++frame) {
      end = flow.Advance(start + frame * kEvery - flow.time());
      const ParticleArrays& p = assembly.particles();
      out << "ITEM: ATOMS x y z radius\n";
      for (std::size_t g = 0; g < p.x.size(); ++g) {
        out << p.x[g] << ' ' << p.y[g] << ' ' << p.z[g] << ' ' << p.radius[g] << '\n';
      }
    }
    if (end != StageEnd::kDone) {
      state.SkipWithError(flow.reason().c_str());
      return;
    }
    state.counters["grains"] = assembly.particles().size();
    state.counters["steps"] = static_cast<double>(assembly.steps());
  }
}

BENCHMARK_CAPTURE(Discharge, silo, &Silo)->Arg(500)->Arg(16'000)->Iterations(kSteps);
BENCHMARK_CAPTURE(Discharge, hopper, &Hopper)->Arg(500)->Arg(10'000)->Iterations(kSteps);
BENCHMARK_CAPTURE(Emptying, hopper, &Hopper)
    ->ArgsProduct({{500, 2000}, {1, 2, 3, 4, 5, 6, 7, 8}})
    ->Iterations(1);
BENCHMARK_CAPTURE(Moving, drum, &Drum)
    ->ArgsProduct({{100, 1000}, {1, 2, 3, 4, 5, 6, 7, 8}})
    ->Iterations(1);
BENCHMARK_CAPTURE(Moving, heap, &Cylinder)
    ->ArgsProduct({{100, 1000}, {1, 2, 3, 4, 5, 6, 7, 8}})
    ->Iterations(1);

}  // namespace
}  // namespace calib::dem
