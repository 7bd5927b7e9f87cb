// `rotating_drum`: one filling, a speed for each value of the control; the slope while it turns.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "dem/elementary/functions.h"
#include "dem/lab_tests/shared/gravity_run.h"
#include "dem/lab_tests/shared/gravity_test.h"
#include "dem/measure/free_surface.h"

namespace calib::dem {

namespace {

/// Flat sides of the drum [-]. Chosen: its inner radius varies by 0.2 %.
constexpr int kSides = 48;
/// Share of the drum that grains fill where the test chooses the diameter [-]. Chosen: about a
/// third.
constexpr double kFill = 0.33;
/// Solid fraction of the fill [-]. Chosen: that of poured grains; the diameter follows from it.
constexpr double kSolidFraction = 0.58;
/// Factor by which a chosen radius grows until all grains find room [-]. Chosen.
constexpr double kWider = 1.05;
/// Share of the surface's width whose slope is read [-]. Chosen: its ends bend at the drum.
constexpr double kMiddle = 0.6;

/// Why grains cannot tumble at a speed [rad/s] in a drum of an inner diameter [m] > 0, in a
/// sentence; empty: they can. From a Froude number omega^2 R / g of 1 on they are carried around.
/// gravity [m/s^2] > 0
std::string CentrifugeProblem(double speed, double diameter, double gravity) {
  const double froude = speed * speed * 0.5 * diameter / gravity;
  if (!(froude >= 1)) {
    return "";
  }
  return absl::StrCat("rotation_speed ", speed, " rad/s has a Froude number omega^2 R / g of ",
                      froude, " in a drum of ", diameter,
                      " m, which carries the grains around from 1 on: have it turn slower than ",
                      std::sqrt(2 * gravity / diameter), " rad/s");
}

/// Within a circle of that radius about (radius, radius).
FillRegion Inside(double radius, double length) {
  return {.low = {0, 0, 0},
          .width = 2 * radius,
          .depth = length,
          .height = 2 * radius,
          .holds =
              [radius](const Vec3& c, double r) {
                return Hypotenuse(c.x - radius, c.z - radius) + r <
                       radius * Cosine(std::numbers::pi / kSides);
              },
          .repeats = true};
}

StageEnd Turn(GravityRun& run, const Assembly& filled, const FlowOptions& options,
              const ControlPoint& point) {
  const double speed = point.target;
  if (!(speed > 0)) {
    return run.Fail(absl::StrCat("rotation_speed is ", speed, ", the drum has to turn"));
  }
  Assembly assembly = filled;
  const auto first = GravityRun::MarkOf(assembly);
  assembly.mutable_walls()[0].angular_velocity = {0, -speed, 0};
  Flow flow = run.MakeFlow(assembly, options);
  StageEnd end = flow.Advance(0.25 * 2 * std::numbers::pi / speed);
  const double stop = flow.time() + run.Setting("turns") * 2 * std::numbers::pi / speed;
  double sum = 0;
  double squares = 0;
  int looks = 0;
  while (end == StageEnd::kDone && flow.time() < stop) {
    end = flow.Advance(run.fall_time());
    const auto slope = SurfaceSlope(assembly.particles(), run.mean_diameter(), kMiddle);
    if (!slope) {
      return run.Fail("the drum holds too few grains: its surface has fewer than three columns");
    }
    sum += *slope;
    squares += *slope * *slope;
    ++looks;
  }
  end = run.AddToSummary(end, flow, first, absl::StrCat("rotation_speed ", speed, " rad/s"));
  if (end != StageEnd::kDone) {
    return end;
  }
  const double mean = sum / looks;
  return run.Report(point, {speed, mean, std::sqrt(std::max(0.0, squares / looks - mean * mean))},
                    assembly);
}

StageEnd Walk(GravityRun& run) {
  const double d = run.largest_diameter();
  const double length = run.SettingOr("drum_length", 6 * d);
  double solid = 0;
  for (const double r : run.radii()) {
    solid += 4.0 / 3.0 * std::numbers::pi * r * r * r;
  }
  const double area = solid / kSolidFraction / length / kFill;
  const bool chosen = !(run.Setting("drum_diameter") > 0);
  double radius = 0.5 * run.SettingOr("drum_diameter", 2 * std::sqrt(area / std::numbers::pi));
  while (chosen && LooseFill(run.radii(), Inside(radius, length), run.seed()).x.size() <
                       run.radii().size()) {  // of spheres, whatever the shape
    radius *= kWider;
  }
  Packing grains = run.Fill(Inside(radius, length), run.seed());
  if (run.CountOf(grains) < run.radii().size()) {
    return run.Fail(absl::StrCat("a drum of ", 2 * radius, " m holds only ", run.CountOf(grains),
                                 " of ", run.radii().size(),
                                 " grains, set loosely into it: make drum_diameter or drum_length "
                                 "larger, or take fewer grains"));
  }
  double fastest = 0;
  for (const ControlPoint& point : run.path()) {
    fastest = std::max(fastest, point.target);
  }
  if (std::string problem = CentrifugeProblem(fastest, 2 * radius, run.gravity());
      !problem.empty()) {
    return run.Fail(std::move(problem));
  }
  const Vec3 axis{radius, 0, radius};
  grains.length[0] = grains.length[2] = 2 * radius;
  grains.length[1] = length;
  TriangleMesh side;
  AddFrustumAlongY({.centre = {axis.x, -d, axis.z},
                    .height = length + 2 * d,
                    .lower_radius = radius,
                    .upper_radius = radius,
                    .sides = kSides},
                   side);
  Wall drum = MakeMeshWall("drum", side);
  drum.centre = axis;
  Assembly assembly = run.MakeAssembly(grains, {.open = {true, false, true}, .walls = {drum}});
  const double far = 2 * radius + d;
  const FlowOptions options{
      .drop_height = 2 * radius, .low = {-d, -1e300, -d}, .high = {far, 1e300, far}};
  return run.WalkFrom(
      assembly, options, run.LongestSettling(2 * radius),
      [&](const ControlPoint& point) { return Turn(run, assembly, options, point); });
}

/// Of a drum whose diameter is given; one that is chosen is looked at by the run.
std::vector<std::string> Problems(const Scenario& scenario) {
  const double diameter = GivenSetting(scenario, "drum_diameter");
  const double gravity = GivenSetting(scenario, "gravity", kGravity);
  if (!(diameter > 0) || !(gravity > 0) || scenario.path.empty()) {
    return {};
  }
  const auto fastest =
      std::max_element(scenario.path.begin(), scenario.path.end(),
                       [](const auto& a, const auto& b) { return a.target < b.target; });
  std::string problem = CentrifugeProblem(fastest->target, diameter, gravity);
  return problem.empty() ? std::vector<std::string>{} : std::vector<std::string>{problem};
}

GrainRemarks Remarks(const Scenario& scenario, const GrainSizes& grains) {
  const double d = grains.largest_diameter();
  const double diameter = GivenSetting(scenario, "drum_diameter");
  const double length = GivenSetting(scenario, "drum_length", 6 * d);
  GrainRemarks remarks;
  if (std::string problem = NarrowProblem(scenario, {.setting = "drum_diameter",
                                                     .grains = "the largest grain",
                                                     .least = d,
                                                     .why = "it does not fit into the drum"});
      !problem.empty()) {
    remarks.refused.push_back(std::move(problem));
    return remarks;
  }
  double solid = 0;
  for (const double r : grains.radii) {
    solid += 4.0 / 3.0 * std::numbers::pi * r * r * r;
  }
  const double room = 0.25 * std::numbers::pi * diameter * diameter * length;
  if (diameter > 0 && solid > room) {
    remarks.refused.push_back(absl::StrCat("the drum, drum_diameter ", diameter, " m, holds ", room,
                                           " m^3, the ", grains.radii.size(), " grains have ",
                                           solid, " m^3"));
  }
  return remarks;
}

}  // namespace

TestEntry RotatingDrum() {
  return {
      .info = {.name = "rotating_drum",
               .description =
                   "Grains are poured into a horizontal drum (48 flat sides, "
                   "periodic along its axis) and come to rest; the drum "
                   "turns. Control: rotation_speed, each from the same filled drum. "
                   "After a quarter turn the slope of the "
                   "surface over the middle 60 % of its width is averaged over "
                   "`turns`. Fails when the drum is too small for "
                   "the grains, so fast that they stick to it (Froude number omega^2 R / g of 1 "
                   "or more) or a grain escapes",
               .settings = WithCommonSettings(
                   {Chosen("drum_diameter", "m",
                           "inner diameter; 0: so that the grains fill a third, or a quarter to a "
                           "seventh where "
                           "sizes differ much: they have to fit in loosely first"),
                    Chosen("drum_length", "m",
                           "of the periodic slice; 0: six largest grain diameters"),
                    Setting("turns", "1", {.value = 0.25, .min = 0.01, .max = 1000},
                            "turns over which is averaged")}),
               .observables = {"rotation_speed", "angle_of_repose", "angle_fluctuation"},
               .control = "rotation_speed",
               .may_reverse = true,
               .reference = "Coetzee, Powder Technol. 310 (2017) 104, sec. 3 (drum test)",
               .poured = true,
               .separate_points = true,
               .control_range = ControlRange{.min = 0, .max = 1000},
               .has_walls = true,
               .bodies = {"walls"}},
      .place = 80,
      .procedure = GravityProcedure(&Walk),
      .problems = &Problems,
      .grain_remarks = &Remarks};
}

}  // namespace calib::dem
