// `shaken_box`: a plane of grains and a large one in a box that is moved and tilted.
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/elementary/functions.h"
#include "dem/lab_tests/shared/gravity_run.h"
#include "dem/lab_tests/shared/gravity_test.h"

namespace calib::dem {

namespace {

/// Width of the box over the largest grain's diameter, and diameter of the intruder over the same,
/// where none is given [-]. [Hadjidoukas 2014, sec. 5.2]
constexpr double kBoxWidth = 8.05;
constexpr double kIntruderRatio = 2;

/// Where the box is at a time, from its place at rest. [Hadjidoukas 2014, Eq. 16]
struct Shaking {
  double ax = 0, az = 0, w = 0, tilt = 0, tilt_w = 0;

  [[nodiscard]] Vec3 Shift(double t) const {
    return {ax * (Cosine(w * t) - 1.0), 0, az * Sine(w * t)};
  }
  [[nodiscard]] double Tilt(double t) const { return tilt * Sine(tilt_w * t); }
};

/// How long the intruder has been above a height, and when it came there first.
struct Watch {
  double height = 0;
  double above = 0;
  double first = -1;  ///< not yet
};

StageEnd Walk(GravityRun& run) {
  const double d = run.largest_diameter();
  const double width = run.SettingOr("box_width", kBoxWidth * d);
  const double big = 0.5 * d * run.Setting("intruder_ratio");
  const double start = std::max(big, run.Setting("intruder_start"));
  const double rate = std::sqrt(run.gravity() / d);  // scales the published box of 20 mm disks
  const Shaking shaking{.ax = run.SettingOr("amplitude_x", 2.5 * d),
                        .az = run.SettingOr("amplitude_z", 4.15 * d),
                        .w = run.SettingOr("frequency", 0.768 * rate),
                        .tilt = run.Setting("tilt"),
                        .tilt_w = run.SettingOr("tilt_frequency", 8.13 * rate)};
  Watch watch{.height = run.SettingOr("height", 5 * d)};
  const double side = 2 * shaking.ax + 2 * d;  // room for the motion in the grid of cells
  const Vec3 intruder{side + 0.5 * width, 0, start};
  if (!(2 * big < width)) {
    return run.Fail("box_width is too small for the intruder");
  }
  Packing grains = run.Fill({.low = {side, 0, 0},
                             .width = width,
                             .holds =
                                 [&](const Vec3& c, double r) {
                                   return c.x - r > side && c.x + r < side + width &&
                                          Hypotenuse(c.x - intruder.x, c.z - start) > r + big;
                                 }},
                            run.seed());
  if (run.CountOf(grains) < run.radii().size()) {
    return run.Fail("box_width is too small: no grain fits into the box");
  }
  run.MixMaterials(grains);
  if (const std::string made_of = run.MaterialOf("intruder");
      !made_of.empty() || !grains.material.empty()) {
    grains.material.resize(grains.x.size());
    grains.material.push_back(made_of);
  }
  grains.x.push_back(intruder.x);
  grains.y.push_back(0);
  grains.z.push_back(start);
  grains.radius.push_back(big);
  grains.clump.push_back(-1);
  const int intruder_id = static_cast<int>(grains.x.size()) - 1;
  const double top = std::max(2 * width, TopOf(grains) + 10 * d);
  grains.length[0] = 2 * side + width;
  grains.length[1] = 8 * big;
  grains.length[2] = top;

  TriangleMesh mesh;
  const double far = 4 * big;  // along y, where nothing moves
  const auto plate = [&](double x1, double z1, double x2, double z2) {
    AddQuad({x1, -far, z1}, {x2, -far, z2}, {x2, far, z2}, {x1, far, z1}, mesh);
  };
  plate(side, 0, side + width, 0);
  plate(side, 0, side, top);
  plate(side + width, 0, side + width, top);
  plate(side, top, side + width, top);
  Wall box = MakeMeshWall("box", mesh);
  box.centre = {side + 0.5 * width, 0, 0.5 * top};
  const Vec3 rest = box.centre;
  Assembly assembly = run.MakeAssembly(
      grains, {.walls = {box}, .planar = true, .thickness = run.Setting("thickness")});
  const double reach = 2 * top + shaking.az;
  const double fastest =
      shaking.w * (shaking.az + shaking.ax) + shaking.tilt * shaking.tilt_w * top;
  Flow flow = run.MakeFlow(assembly, {.drop_height = top + fastest * fastest / (2 * run.gravity()),
                                      .low = {-reach, -reach, -reach},
                                      .high = {side + width + reach, reach, 2 * reach}});
  StageEnd end = StageEnd::kDone;
  double begun = 0;
  if (run.resumed()) {
    std::string moving;
    end = run.RestoreState(moving, begun, watch);
    if (auto s = end == StageEnd::kDone ? flow.Restore(moving) : absl::OkStatus(); !s.ok()) {
      end = run.Abandon(std::move(s));
    }
  } else {
    end = flow.Settle(run.LongestSettling(top), GravityRun::kSettling);
    begun = flow.time();
  }

  /// Height of the intruder above the floor, along the box.
  const auto intruder_height = [&] {
    const ParticleArrays& p = assembly.particles();
    const auto g =
        static_cast<std::size_t>(std::find(p.id.begin(), p.id.end(), intruder_id) - p.id.begin());
    const Wall& now = assembly.walls().walls()[0];
    const Vec3 floor = now.mesh.vertex[0];
    const Vec3 up = now.mesh.vertex[5] - now.mesh.vertex[4];  // of the left plate
    return Dot(Vec3{p.x[g], p.y[g], p.z[g]} - floor, up) / Length(up);
  };
  flow.SetBeforeStep([&](double time, double dt) {
    const double t = time - begun;
    const double h = intruder_height();
    watch.above += h > watch.height ? dt : 0.0;
    watch.first = watch.first < 0 && h >= watch.height ? t : watch.first;
    // Velocities that bring the box to where it has to be after the step.
    Wall& now = assembly.mutable_walls()[0];
    now.velocity = (1.0 / dt) * (rest + shaking.Shift(t + dt) - now.centre);
    now.angular_velocity = {0, (shaking.Tilt(t + dt) - shaking.Tilt(t)) / dt, 0};
  });
  const auto shake = [&](const ControlPoint& point) {
    if (const StageEnd shaken = flow.Advance(point.target - (flow.time() - begun));
        shaken != StageEnd::kDone) {
      return shaken;
    }
    const double t = flow.time() - begun;
    return run.Report(point,
                      {point.target, intruder_height(), t > 0 ? watch.above / t : 0.0,
                       watch.first < 0 ? point.target : watch.first},
                      assembly);
  };
  const auto state = [&] {
    SaveArchive archive;
    std::string moving = flow.Checkpoint();
    double since = begun;
    archive(moving, since, watch);
    return std::move(archive.bytes());
  };
  end = end == StageEnd::kDone ? run.Walk(shake, state) : end;
  return run.AddToSummary(end, flow, {}, "shaking");
}

GrainRemarks Remarks(const Scenario& scenario, const GrainSizes& grains) {
  const double d = grains.largest_diameter();
  const double ratio = GivenSetting(scenario, "intruder_ratio", kIntruderRatio);
  GrainRemarks remarks;
  if (std::string problem = NarrowProblem(scenario, {.setting = "box_width",
                                                     .grains = "the intruder",
                                                     .least = ratio * d,
                                                     .why = "it does not fit into the box"});
      !problem.empty()) {
    remarks.refused.push_back(std::move(problem));
  }
  if (!(GivenSetting(scenario, "box_width") > 0) && ratio >= kBoxWidth) {
    remarks.refused.push_back(absl::StrCat("intruder_ratio is ", ratio, ", the box ", kBoxWidth,
                                           " largest grain diameters wide: give a box_width"));
  }
  return remarks;
}

}  // namespace

TestEntry ShakenBox() {
  return {
      .info = {.name = "shaken_box",
               .description =
                   "One plane of grains (x and z only; spheres, or disks of a thickness) and one "
                   "intruder in a box that moves by x = "
                   "ax cos(w t), z = az sin(w t) and "
                   "tilts by tilt sin(tilt_frequency t). Grains come to rest first, the intruder "
                   "at intruder_start above the floor. "
                   "Control: time. Heights are in the frame of the box. Fails when a grain escapes",
               .settings = WithCommonSettings(
                   {ThicknessOfDisks(),
                    Setting("intruder_ratio", "1", {.value = kIntruderRatio, .min = 1, .max = 20},
                            "diameter of the intruder over the largest grain's"),
                    Chosen("intruder_start", "m",
                           "height of its centre before the others fall about it; 0: on the floor"),
                    Chosen("box_width", "m", "0: 8.05 largest grain diameters"),
                    Chosen("amplitude_x", "m", "ax; 0: 2.5 largest grain diameters"),
                    Chosen("amplitude_z", "m", "az; 0: 4.15 largest grain diameters"),
                    Chosen("frequency", "rad/s",
                           "w; 0: 0.768 sqrt(gravity / largest grain diameter)"),
                    Setting("tilt", "rad", {.value = 0.03490658503988659, .min = 0, .max = 0.5},
                            "amplitude of the tilt"),
                    Chosen("tilt_frequency", "rad/s",
                           "of the tilt; 0: 8.13 sqrt(gravity / largest grain diameter)"),
                    Chosen("height", "m",
                           "of fraction_above and exit_time; 0: five largest grain diameters")}),
               .observables = {"time", "intruder_height", "fraction_above", "exit_time"},
               .control = "time",
               .may_reverse = false,
               .reference = "Hadjidoukas et al. 2014, sec. 5.2, Eq. 16",
               .poured = true,
               .separate_points = false,
               .control_range = ControlRange{.min = 0, .max = 1e5},
               .has_walls = true,
               .planar = true,
               .bodies = {"walls", "intruder"}},
      .place = 110,
      .procedure = GravityProcedure(&Walk),
      .grain_remarks = &Remarks};
}

}  // namespace calib::dem
