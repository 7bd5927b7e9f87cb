// `angle_of_repose`: a cylinder is filled and lifted; the heap that stays.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/elementary/functions.h"
#include "dem/lab_tests/shared/gravity_run.h"
#include "dem/lab_tests/shared/gravity_test.h"
#include "dem/measure/free_surface.h"

namespace calib::dem {

namespace {

/// Flat sides of the cylinder [-]. Chosen: its inner radius varies by 0.5 %.
constexpr int kSides = 32;
/// Solid fraction of the filling [-]. Chosen: that of poured grains; the radius follows from it.
constexpr double kSolidFraction = 0.58;
/// Grains below which a heap is too small for its slope [-]. At friction 0.5 and rolling friction
/// 0.3 the angle is 0 deg with 100 grains, 8.1 with 300 and 16.9 with 600 (one run each) and still
/// rises; a slope of ten grains needs about a thousand.
constexpr std::size_t kFewestInHeap = 1000;

StageEnd Repeat(GravityRun& run, const ControlPoint& point) {
  const double d = run.largest_diameter();
  double solid = 0;
  for (const double r : run.radii()) {
    solid += 4.0 / 3.0 * std::numbers::pi * r * r * r;
  }
  const double radius =
      0.5 *
      run.SettingOr("cylinder_diameter",
                    std::max(3 * d, CubeRoot(4 * solid / (kSolidFraction * std::numbers::pi))));
  const double inner = radius * Cosine(std::numbers::pi / kSides);
  const double speed =
      run.SettingOr("lift_speed", 0.15 * std::sqrt(run.gravity() * run.mean_diameter()));
  const Vec3 axis{4 * radius, 4 * radius, 0};
  Packing grains = run.Fill(
      {.low = {axis.x - radius, axis.y - radius, 0},
       .width = 2 * radius,
       .depth = 2 * radius,
       .holds = [&](const Vec3& c,
                    double r) { return Hypotenuse(c.x - axis.x, c.y - axis.y) + r < inner; }},
      run.seed() + static_cast<std::uint64_t>(std::llround(1e6 * point.target)) * 1'000'003U);
  if (run.CountOf(grains) < run.radii().size()) {
    return run.Fail("cylinder_diameter is too small: no grain fits into the cylinder");
  }
  const double top = TopOf(grains);
  grains.length[0] = grains.length[1] = 8 * radius;
  grains.length[2] = top;
  TriangleMesh side;
  AddFrustum({.centre = axis,
              .height = top + d,
              .lower_radius = radius,
              .upper_radius = radius,
              .sides = kSides},
             side);
  Assembly assembly = run.MakeAssembly(grains, {.walls = {MakePlane("floor", {0, 0, 0}, {0, 0, 1}),
                                                          MakeMeshWall("cylinder", side)}});
  const double far = 100 * radius + 10 * top;
  Flow flow = run.MakeFlow(
      assembly, {.drop_height = top, .low = {-far, -far, -d}, .high = {far, far, top + far}});
  const double longest = run.LongestSettling(top);
  StageEnd end = flow.Settle(longest, GravityRun::kSettling);
  if (end == StageEnd::kDone) {
    double heap = 0;
    for (std::size_t g = 0; g < assembly.particles().z.size(); ++g) {
      heap = std::max(heap, assembly.particles().z[g] + assembly.particles().radius[g]);
    }
    assembly.mutable_walls()[1].velocity = {0, 0, speed};
    end = flow.Advance((heap + d) / speed);
  }
  if (end == StageEnd::kDone) {
    assembly.mutable_walls()[1].active = false;
    assembly.mutable_walls()[1].velocity = {};
    assembly.SearchAgain();
    end = flow.Settle(longest, run.Setting("local_damping"));
  }
  end = run.AddToSummary(end, flow, {}, absl::StrCat("repetition ", point.target));
  if (end != StageEnd::kDone) {
    return end;
  }
  const Heap heap = ConicalHeap(assembly.particles(), axis, run.mean_diameter());
  return run.Report(point, {point.target, heap.angle, heap.height}, assembly);
}

StageEnd Walk(GravityRun& run) {
  return run.Walk([&](const ControlPoint& point) { return Repeat(run, point); });
}

GrainRemarks Remarks(const Scenario& scenario, const GrainSizes& grains) {
  GrainRemarks remarks;
  if (std::string problem = NarrowProblem(scenario, {.setting = "cylinder_diameter",
                                                     .grains = "the largest grain",
                                                     .least = grains.largest_diameter(),
                                                     .why = "it does not fit into the cylinder"});
      !problem.empty()) {
    remarks.refused.push_back(std::move(problem));
  }
  if (grains.radii.size() < kFewestInHeap) {
    remarks.few = absl::StrCat("with fewer than about ", kFewestInHeap,
                               " the slope is lower than that of many, and friction is found too "
                               "high; 100 grains make no heap at all");
  }
  return remarks;
}

}  // namespace

TestEntry AngleOfRepose() {
  return {
      .info = {.name = "angle_of_repose",
               .description =
                   "Grains are poured into a cylinder on a level floor and come to rest; the "
                   "cylinder is lifted at "
                   "lift_speed and the heap comes to rest. Control: the number of the repetition, "
                   "each poured "
                   "anew. angle_of_repose is the slope of the line through the heap's surface "
                   "(mean of eight "
                   "sectors, rings of one diameter) between 15 and 85 % of its height, 0 where no "
                   "heap stands. "
                   "Fails when a grain escapes or overlaps a wall by more than half its radius",
               .settings = WithCommonSettings(
                   {Chosen("cylinder_diameter", "m",
                           "inner diameter; 0: as wide as the filling is high"),
                    Chosen("lift_speed", "m/s",
                           "of the cylinder; 0: 0.15 sqrt(gravity x mean diameter)")}),
               .observables = {"repetition", "angle_of_repose", "heap_height"},
               .control = "repetition",
               .may_reverse = true,
               .reference = "Coetzee, Powder Technol. 310 (2017) 104, sec. 3 (bulk calibration); "
                            "Samuelsson 2023, sec. 1",
               .poured = true,
               .separate_points = true,
               .control_range = ControlRange{.min = 0, .max = 1e6, .whole = true},
               .has_walls = true,
               .bodies = {"walls"}},
      .place = 60,
      .procedure = GravityProcedure(&Walk),
      .grain_remarks = &Remarks};
}

}  // namespace calib::dem
