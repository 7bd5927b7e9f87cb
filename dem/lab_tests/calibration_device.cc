// `calibration_device`: hopper, slide and pile, a slice of it, poured anew for each repetition.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "dem/elementary/functions.h"
#include "dem/geometry/mesh_rims.h"
#include "dem/lab_tests/shared/gravity_run.h"
#include "dem/lab_tests/shared/gravity_test.h"
#include "dem/lab_tests/shared/mass_flow.h"
#include "dem/measure/free_surface.h"

namespace calib::dem {

namespace {

/// Slope of the hopper's walls, 60 degrees [rad]. Chosen.
constexpr double kHopperSlope = 1.0471975511965976;
/// Solid fraction of a loose pile [-]. Chosen: sizes of the device and the longest duration follow
/// from it.
constexpr double kPiled = 0.55;
/// Looks at the masses in a fall by half a mean diameter [-]. Chosen: times are read to a
/// twentieth of that fall.
constexpr int kLooks = 20;
/// Share of the material below which the slide counts as empty [-]. Chosen: a few grains may stick.
constexpr double kOnSlide = 0.003;
/// What is added to the slide time per share of the material that never leaves the slide [s].
/// Chosen: the observable goes on growing where nothing slides.
constexpr double kPenalty = 10;
/// Shares of the first mass between which the flow counts as steady [-]. Chosen: start and end left
/// out.
constexpr double kFlowing[] = {0.1, 0.9};
/// The device is at rest where over kQuietFalls falls by half a mean diameter, one after the other,
/// the mean square speed is below kQuiet g d [-]. Chosen: less than 1 % of the speed of such a
/// fall.
constexpr double kQuiet = 1e-4;
constexpr int kQuietFalls = 5;

/// Places in the plane of x and z, x = 0 below the outlet, the pile's corner at the left.
struct Device {
  double opening = 0;
  double depth = 0;                 ///< period along y
  double outlet = 0;                ///< height of the outlet
  double upper_x = 0, upper_z = 0;  ///< ends of the slide
  double lower_x = 0, lower_z = 0;
  double corner = 0;                  ///< x of the wall beside the pile
  double hopper_x = 0, hopper_z = 0;  ///< where the hopper's slopes become vertical
};

Device Plan(const GravityRun& run) {
  const double d = run.mean_diameter();
  Device device;
  device.opening = run.SettingOr("opening", 6 * d);
  device.depth = run.SettingOr("depth", 6 * run.largest_diameter());
  const double angle = run.Setting("slide_angle");
  const double length = run.SettingOr("slide_length", 16 * d);
  const double dx = length * Cosine(angle);
  const double dz = length * Sine(angle);
  device.lower_z =
      run.SettingOr("slide_height",
                    std::max(10 * d, std::sqrt(2 * run.solid_volume() / (kPiled * device.depth))));
  device.upper_x = device.opening;
  device.upper_z = device.lower_z + dz;
  device.lower_x = device.upper_x - dx;
  device.corner = device.lower_x - 10 * d;
  device.outlet = device.upper_z + 2 * d;
  device.hopper_z = device.outlet + 12 * d;
  device.hopper_x = 0.5 * device.opening + 12 * d / Tangent(kHopperSlope);
  return device;
}

/// A plate along y from (x1, z1) to (x2, z2), longer than the slice by `overhang` at both ends.
void AddPlate(double x1, double z1, double x2, double z2, double depth, double overhang,
              TriangleMesh& mesh) {
  AddQuad({x1, -overhang, z1}, {x2, -overhang, z2}, {x2, depth + overhang, z2},
          {x1, depth + overhang, z1}, mesh);
}

/// Mass that leaves the hopper per time, over the looks in kFlowing of the first mass [kg/s].
double LossRate(const std::vector<double>& time, const std::vector<double>& mass) {
  const std::optional<double> slope =
      SlopeBetween(time, mass, kFlowing[0] * mass.front(), kFlowing[1] * mass.front(), 2);
  return slope ? -*slope : (mass.front() - mass.back()) / (time.back() - time.front());
}

struct Masses {
  double hopper = 0, slide = 0, total = 0;
  double buries = 0;  ///< what lies above the slide's lower end, beyond it
  double top = 0;     ///< of that, a height
};

/// A sphere carries the mass of its grain (RigidClumps), of which it is one of `spheres`.
Masses Weigh(const ParticleArrays& p, int spheres, const Device& device) {
  Masses masses;
  for (std::size_t g = 0; g < p.x.size(); ++g) {
    const double mass = 1.0 / (spheres * p.inverse_mass[g]);
    masses.total += mass;
    if (p.z[g] > device.outlet) {
      masses.hopper += mass;
    } else if (p.x[g] > device.lower_x && p.z[g] > device.lower_z) {
      masses.slide += mass;
    } else if (p.x[g] < device.lower_x - 2 * p.radius[g] && p.z[g] > device.lower_z) {
      masses.buries += mass;
      masses.top = std::max(masses.top, p.z[g] + p.radius[g]);
    }
  }
  return masses;
}

/// Long enough for three times what a slot of six diameters takes: its flow is
/// 0.55 sqrt(g) (0.7 x 6 d)^{3/2} depth of solid per time. [Beverloo's form in the plane]
double LongestFlow(const GravityRun& run, const Device& device) {
  const double width = 4.2 * run.mean_diameter();
  const double flow = kPiled * std::sqrt(run.gravity()) * width * std::sqrt(width) * device.depth;
  return std::max(200 * run.fall_time(), 3 * run.solid_volume() / flow);
}

StageEnd Measure(GravityRun& run, const Device& device, const ControlPoint& point, Flow& flow) {
  Assembly& assembly = flow.assembly();
  const double opened = flow.time();
  const double longest = run.SettingOr("duration", LongestFlow(run, device));
  std::vector<double> time = {0};
  std::vector<double> hopper = {
      Weigh(assembly.particles(), run.spheres_per_grain(), device).hopper};
  double last_on_slide = 0;
  StageEnd end = StageEnd::kDone;
  int still = 0;
  Masses masses;
  const double look = run.fall_time() / kLooks;
  flow.SetBeforeStep([&](double now, double) {
    if (now - opened >= look * static_cast<double>(time.size())) {
      masses = Weigh(assembly.particles(), run.spheres_per_grain(), device);
      time.push_back(now - opened);
      hopper.push_back(masses.hopper);
      last_on_slide = masses.slide >= kOnSlide * masses.total ? time.back() : last_on_slide;
    }
  });
  while (end == StageEnd::kDone && time.back() < longest && still < kQuietFalls) {
    end = flow.Advance(run.fall_time());
    const double quiet = kQuiet * run.gravity() * run.mean_diameter();
    still = flow.MeanSquareSpeed() < quiet ? still + 1 : 0;
  }
  if (end != StageEnd::kDone) {
    return end;
  }
  masses = Weigh(assembly.particles(), run.spheres_per_grain(), device);
  if (masses.buries >= kOnSlide * masses.total) {
    return run.Fail(absl::StrCat(
        "repetition ", point.target, ", pile: it has grown over the slide's lower end, up to ",
        masses.top, " m where that stands at ", device.lower_z,
        " m, so that neither flow nor slope are the material's: ",
        run.Setting("slide_height") > 0 ? "raise slide_height" : "set a slide_height above that",
        ", make depth larger, or take fewer grains"));
  }
  const bool stays = masses.slide >= kOnSlide * masses.total;
  const double slide_time =
      stays ? time.back() + kPenalty * masses.slide / masses.total : last_on_slide;
  const auto pile = SigmoidPile(assembly.particles(),
                                {.wall = device.corner,
                                 .end = device.corner + 4 * (device.upper_x - device.corner),
                                 .highest = device.lower_z},
                                run.mean_diameter());
  if (!pile) {
    return run.Fail("nothing has piled up: fewer than four columns hold grains below the slide");
  }
  return run.Report(point, {point.target, LossRate(time, hopper), slide_time, pile->angle},
                    assembly);
}

StageEnd Repeat(GravityRun& run, const Device& device, const ControlPoint& point) {
  const double d = run.largest_diameter();
  const double half = device.hopper_x;
  Packing grains = run.Fill(
      {.low = {-half, 0, device.outlet},
       .width = 2 * half,
       .depth = device.depth,
       .holds =
           [&](const Vec3& c, double r) {
             const double up = c.z - device.outlet - 2 * r;
             const double room =
                 std::min(half, 0.5 * device.opening + up / Tangent(kHopperSlope)) - r;
             return std::abs(c.x) < room;
           },
       .repeats = true},
      run.seed() + static_cast<std::uint64_t>(std::llround(1e6 * point.target)) * 1'000'003U);
  if (run.CountOf(grains) < run.radii().size()) {
    return run.Fail("the hopper is too small for the grains");
  }
  const double top = TopOf(grains);
  const double width = 4 * (device.upper_x - device.corner);
  grains.length[0] = width;
  grains.length[1] = device.depth;
  grains.length[2] = top;
  const double shift = -device.corner;  // the grid of cells begins at x = 0
  for (double& x : grains.x) {
    x += shift;
  }
  Device here = device;
  for (double* x : {&here.upper_x, &here.lower_x, &here.corner}) {
    *x += shift;
  }
  TriangleMesh hopper;
  for (const double side : {-1.0, 1.0}) {
    AddPlate(shift + side * 0.5 * device.opening, device.outlet, shift + side * half,
             device.hopper_z, device.depth, d, hopper);
    AddPlate(shift + side * half, device.hopper_z, shift + side * half, top + 10 * d, device.depth,
             d, hopper);
  }
  TriangleMesh trapdoor;
  AddPlate(shift - 0.5 * device.opening, device.outlet, shift + 0.5 * device.opening, device.outlet,
           device.depth, d, trapdoor);
  TriangleMesh slide;
  if (const TriangleMesh* own = run.Mesh("slide"); own != nullptr) {
    slide = Shifted(*own, {here.lower_x, 0.5 * device.depth, here.lower_z});
  } else {
    AddPlate(here.upper_x, here.upper_z, here.lower_x, here.lower_z, device.depth, d, slide);
  }
  AddPlate(here.upper_x, here.upper_z, here.upper_x, device.outlet, device.depth, d, slide);
  Assembly assembly = run.MakeAssembly(
      grains, {.open = {true, false, true},
               .walls = {MakePlane("floor", {0, 0, 0}, {0, 0, 1}),
                         MakePlane("corner", {0, 0, 0}, {1, 0, 0}), MakeMeshWall("hopper", hopper),
                         MakeMeshWall("slide", slide), MakeMeshWall("trapdoor", trapdoor)}});
  Flow flow = run.MakeFlow(
      assembly,
      {.drop_height = top, .low = {-d, -1e300, -d}, .high = {100 * width, 1e300, 2 * top}});
  StageEnd end = flow.Settle(run.LongestSettling(top), GravityRun::kSettling);
  if (end == StageEnd::kDone) {
    assembly.mutable_walls().back().active = false;
    assembly.SearchAgain();
    end = Measure(run, here, point, flow);
  }
  return run.AddToSummary(end, flow, {}, absl::StrCat("repetition ", point.target));
}

StageEnd Walk(GravityRun& run) {
  const Device device = Plan(run);
  if (const TriangleMesh* slide = run.Mesh("slide"); slide != nullptr) {
    const Bounds bounds = BoundsOf(*slide);
    const double reach = 0.5 * device.depth + run.largest_diameter();
    const double found = std::min(-bounds.low.y, bounds.high.y);
    if (!(found >= (1 - 1e-6) * reach)) {
      return run.Fail(absl::StrCat("mesh slide reaches to ", found, " m from its middle along y, ",
                                   "the slice and a grain beyond it take ", reach,
                                   " m: widen it, or set a smaller depth"));
    }
    if (const std::string problem = SlideProblemAcross(*slide, (1 - 1e-6) * reach);
        !problem.empty()) {
      return run.Fail("mesh slide " + problem);
    }
  }
  return run.Walk([&](const ControlPoint& point) { return Repeat(run, device, point); });
}

GrainRemarks Remarks(const Scenario& scenario, const GrainSizes& grains) {
  GrainRemarks remarks;
  if (std::string problem =
          NarrowProblem(scenario, {.setting = "opening",
                                   .grains = "the smallest grain",
                                   .least = grains.thickness * grains.smallest_diameter(),
                                   .why = "nothing flows out"});
      !problem.empty()) {
    remarks.refused.push_back(std::move(problem));
  }
  return remarks;
}

}  // namespace

TestEntry CalibrationDevice() {
  return {
      .info =
          {.name = "calibration_device",
           .description =
               "A slice, periodic along y: a hopper with walls at 60 degrees is filled "
               "above a trapdoor; the trapdoor opens, the "
               "material slides down a plate and piles up in a corner. Control: the "
               "number of the repetition, each poured "
               "anew. mass_flow_rate is the slope of the mass in the hopper between 90 "
               "and 10 % of it; slide_time the last "
               "time at which the slide bears at least 0.3 % of the material, or, where "
               "that never leaves it, the time of the "
               "end + 10 s x the share that stays, looked at 20 times per sqrt(mean "
               "diameter / gravity); angle_of_repose the slope at the "
               "inflexion of a sigmoid through the pile's "
               "surface. Fails when a grain escapes, when nothing piles up, or when the pile has "
               "grown to the slide's lower end, which it then buries",
           .settings = WithCommonSettings(
               {Chosen("opening", "m", "width of the outlet; 0: six mean grain diameters"),
                Setting("slide_angle", "rad", {.value = 0.7853981633974483, .min = 0.1, .max = 1.4},
                        "of the plate below the horizontal"),
                Chosen("slide_length", "m", "0: 16 mean grain diameters"),
                Chosen("slide_height", "m",
                       "of the slide's lower end above the floor; 0: ten mean grain diameters, or "
                       "more where a pile at 45 degrees of all grains, a solid fraction of 0.55 of "
                       "it, would stand higher"),
                Chosen("depth", "m", "of the periodic slice; 0: six largest grain diameters"),
                Chosen("duration", "s",
                       "longest time after opening; 0: 200 sqrt(mean diameter / gravity), or for "
                       "large "
                       "fillings three times what they take through six mean grain diameters")}),
           .observables = {"repetition", "mass_flow_rate", "slide_time", "angle_of_repose"},
           .control = "repetition",
           .may_reverse = true,
           .reference = "Samuelsson 2023, sec. 4.1",
           .poured = true,
           .separate_points = true,
           .control_range = ControlRange{.min = 0, .max = 1e6, .whole = true},
           .meshes =
               {{.name = "slide",
                 .description =
                     "replaces the plate (a solid, or a sheet without holes, its ends "
                     "straight across the slice). Origin: the middle of the plate's lower end as "
                     "slide_angle and slide_length place it, which place the hopper too; x "
                     "towards the hopper, z upwards, y across the slice, beyond both faces of "
                     "which it has to reach by a largest grain diameter"}},
           .has_walls = true,
           .bodies = {"walls"}},
      .place = 90,
      .procedure = GravityProcedure(&Walk),
      .grain_remarks = &Remarks};
}

}  // namespace calib::dem
