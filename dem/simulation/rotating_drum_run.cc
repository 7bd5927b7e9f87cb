// `rotating_drum`: one filling, a speed for each value of the control; the slope while it turns.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/elementary/functions.h"
#include "dem/lab_tests/rotating_drum.h"
#include "dem/measure/free_surface.h"
#include "dem/simulation/gravity_run.h"

namespace calib::dem {
namespace {

constexpr int kSides = 48;
constexpr double kFill = 0.33;           ///< share of the drum that a chosen diameter fills
constexpr double kSolidFraction = 0.58;  ///< of the fill
constexpr double kWider = 1.05;          ///< step of a chosen radius, until all grains find room
constexpr double kMiddle = 0.6;          ///< share of the surface's width that is looked at

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
  Flow flow = run.Drive(assembly, options);
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
  end = run.Close(end, flow, first, absl::StrCat("rotation_speed ", speed, " rad/s"));
  if (end != StageEnd::kDone) {
    return end;
  }
  const double mean = sum / looks;
  return run.Report(point, {speed, mean, std::sqrt(std::max(0.0, squares / looks - mean * mean))},
                    assembly);
}

}  // namespace

StageEnd RunRotatingDrum(GravityRun& run) {
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
  Assembly assembly = run.Make(grains, {.open = {true, false, true}, .walls = {drum}});
  const double far = 2 * radius + d;
  const FlowOptions options{
      .drop_height = 2 * radius, .low = {-d, -1e300, -d}, .high = {far, 1e300, far}};
  return run.WalkFrom(
      assembly, options, 40 * std::sqrt(2 * radius / run.gravity()),
      [&](const ControlPoint& point) { return Turn(run, assembly, options, point); });
}

}  // namespace calib::dem
