// `silo_discharge`: one filling, an outlet for each value of the control; arches are broken.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "dem/elementary/functions.h"
#include "dem/geometry/mesh_interior.h"
#include "dem/lab_tests/shared/gravity_run.h"
#include "dem/lab_tests/shared/gravity_test.h"
#include "dem/lab_tests/shared/mass_flow.h"
#include "dem/measure/avalanches.h"

namespace calib::dem {

namespace {

/// Flat sides of a round silo [-]. Chosen: its inner radius varies by 0.5 %.
constexpr int kSides = 32;
/// Shares of the drained mass between which the flow counts as steady [-]. Chosen: at the end the
/// surface comes down to the outlet.
constexpr double kFlowing[] = {0.1, 0.7};
/// How far above the others the grain of a broken arch is set down, in its radii [-]. Chosen: clear
/// of them.
constexpr double kDropped = 0.1;
/// Part of jam_time after which one looks whether the flow still goes [-]. Chosen.
constexpr double kLook = 0.25;
/// Width of a silo, or of a flat one, over the mean diameter of its grains, where none is given
/// [-]. Chosen: some hundred grains then stand about as high as wide.
constexpr double kWidth = 12;
constexpr double kFlatWidth = 40;

double ChosenWidth(bool flat, double mean_diameter) {
  return (flat ? kFlatWidth : kWidth) * mean_diameter;
}

/// Width about the outlet that a mesh of the user's leaves [m].
double WidthOf(const TriangleMesh& vessel) {
  const Bounds bounds = BoundsOf(vessel);
  return 2 * std::max({-bounds.low.x, bounds.high.x, -bounds.low.y, bounds.high.y});
}

std::string WideOutlet(double opening, double width) {
  return absl::StrCat("opening ", opening, " m is not smaller than silo_width, ", width, " m");
}

/// A filled silo about the vertical through (middle, middle).
struct Silo {
  bool flat = false;
  double width = 0;   ///< or diameter [m]
  double middle = 0;  ///< [m]
};

Wall FloorWithOutlet(const Silo& silo, double opening, double overhang) {
  TriangleMesh mesh;
  const double m = silo.middle;
  const double far = 0.5 * silo.width + overhang;
  if (silo.flat) {
    for (const double side : {-1.0, 1.0}) {
      const double inner = m + side * 0.5 * opening;
      const double outer = m + side * far;
      AddQuad({inner, m - far, 0}, {outer, m - far, 0}, {outer, m + far, 0}, {inner, m + far, 0},
              mesh);
    }
  } else {
    AddFrustum({.centre = {m, m, 0},
                .height = 0,
                .lower_radius = 0.5 * opening,
                .upper_radius = far,
                .sides = kSides},
               mesh);
  }
  return MakeMeshWall("floor", mesh);
}

/// Grains whose centre stands above the outlet; the lowest first.
std::vector<int> AboveOutlet(const ParticleArrays& p, const Silo& silo, double opening) {
  std::vector<int> above;
  for (int g = 0; g < p.size(); ++g) {
    const auto q = static_cast<std::size_t>(g);
    const double y = silo.flat ? 0 : p.y[q] - silo.middle;
    if (Hypotenuse(p.x[q] - silo.middle, y) < 0.5 * opening) {
      above.push_back(g);
    }
  }
  std::sort(above.begin(), above.end(), [&](int a, int b) {
    const double za = p.z[static_cast<std::size_t>(a)];
    const double zb = p.z[static_cast<std::size_t>(b)];
    return za != zb ? za < zb : a < b;
  });
  return above;
}

/// Takes the lowest grain of an arch out, where there still is one, and sets it on top of the
/// others. EvaluateForces has to follow.
void BreakArch(const std::vector<int>& arch, Assembly& assembly) {
  if (arch.empty()) {
    return;
  }
  const ParticleArrays& p = assembly.particles();
  const auto q = static_cast<std::size_t>(arch.front());
  double top = 0;
  for (std::size_t g = 0; g < p.z.size(); ++g) {
    top = std::max(top, p.z[g] + p.radius[g]);
  }
  if (!assembly.clumps().empty()) {
    const int clump = p.body[q];
    double lowest = top;
    for (const int member : assembly.clumps().all()[static_cast<std::size_t>(clump)].members) {
      const auto m = static_cast<std::size_t>(member);
      lowest = std::min(lowest, p.z[m] - p.radius[m]);
    }
    assembly.Relocate(clump, {0, 0, top + kDropped * p.radius[q] - lowest});
    return;
  }
  const NewGrain grain{.centre = {p.x[q], p.y[q], top + (1 + kDropped) * p.radius[q]},
                       .radius = p.radius[q],
                       .material = p.material.empty() ? 0 : p.material[q]};
  assembly.Remove({arch.front()});
  assembly.Insert({grain});
}

/// Slope of mass over the time of flow, waits left out, over kFlowing of the mass [kg/s].
double FlowRate(const std::vector<Drained>& drained, double jam_time) {
  if (drained.size() < 2) {
    return 0;
  }
  std::vector<double> time;
  std::vector<double> mass;
  double waited = 0;
  double total = 0;
  for (std::size_t k = 0; k < drained.size(); ++k) {
    const double gap = k > 0 ? drained[k].time - drained[k - 1].time : 0;
    waited += gap >= jam_time ? gap : 0;
    total += drained[k].mass;
    time.push_back(drained[k].time - waited);
    mass.push_back(total);
  }
  return SlopeBetween(time, mass, kFlowing[0] * total, kFlowing[1] * total, 3)
      .value_or(total / std::max(time.back() - time.front(), jam_time));
}

StageEnd Discharge(GravityRun& run, const Silo& silo, const Assembly& filled,
                   const FlowOptions& options, const ControlPoint& point) {
  const double opening = point.target;
  const double jam_time = run.SettingOr("jam_time", 20 * run.fall_time());
  const double duration = run.SettingOr("duration", 400 * run.fall_time());
  Assembly assembly = filled;
  const auto first = GravityRun::MarkOf(assembly);
  assembly.mutable_walls()[0] = FloorWithOutlet(silo, opening, run.largest_diameter());
  assembly.SearchAgain();
  Flow flow = run.MakeFlow(assembly, options);
  flow.SetDrain(-2 * run.largest_diameter());
  bool jammed = false;
  flow.SetBeforeStep([&](double, double) {  // forces follow for the grains as they then are
    if (jammed) {
      jammed = false;
      BreakArch(AboveOutlet(assembly.particles(), silo, opening), assembly);
    }
  });
  StageEnd end = StageEnd::kDone;
  int jams = 0;
  Avalanches avalanches;
  std::size_t seen = 0;
  double since = 0;  // time at which something last happened
  const double slice = kLook * jam_time;
  const auto most = static_cast<int>(run.Setting("avalanches"));
  while (end == StageEnd::kDone && flow.time() < duration && assembly.particles().size() > 0) {
    end = flow.Advance(slice);
    if (flow.drained().size() > seen) {
      seen = flow.drained().size();
      since = flow.drained().back().time;
    }
    if (end != StageEnd::kDone || flow.time() - since < jam_time) {
      continue;
    }
    if (AboveOutlet(assembly.particles(), silo, opening).empty()) {
      break;  // it has run empty
    }
    avalanches.Block(flow.drained().size());
    if (++jams >= most) {
      break;
    }
    jammed = true;
    since = flow.time();
  }
  end = run.AddToSummary(end, flow, first, absl::StrCat("opening ", opening, " m"));
  if (end != StageEnd::kDone) {
    return end;
  }
  double mass = 0;
  for (const Drained& grain : flow.drained()) {
    mass += grain.mass;
  }
  const auto left = static_cast<double>(flow.drained().size());
  const bool ended = avalanches.count() > 0;  // else one goes on, whose size is not known
  return run.Report(
      point,
      {opening, FlowRate(flow.drained(), jam_time), mass, ended ? avalanches.Mean() : left,
       static_cast<double>(jams), static_cast<double>(avalanches.count()),
       ended ? avalanches.ExceededBy(0.5) : left, ended ? avalanches.ExceededBy(0.1) : left},
      assembly);
}

StageEnd Walk(GravityRun& run) {
  const double d = run.largest_diameter();
  Silo silo{.flat = run.Setting("flat") >= 0.5};
  silo.width = run.SettingOr("silo_width", ChosenWidth(silo.flat, run.mean_diameter()));
  TriangleMesh vessel;  // the user's, about the outlet
  if (run.Mesh("silo") != nullptr) {
    vessel = *run.Mesh("silo");
    silo.width = WidthOf(vessel);
  }
  silo.middle = 0.5 * silo.width + d;
  for (const ControlPoint& point : run.path()) {
    if (!(point.target < silo.width)) {
      return run.Fail(WideOutlet(point.target, silo.width));
    }
  }
  const double m = silo.middle;
  const double inner = 0.5 * silo.width * Cosine(std::numbers::pi / kSides);
  vessel = Shifted(std::move(vessel), {m, m, 0});
  const bool own = vessel.size() > 0;
  const MeshInterior interior(vessel);
  Packing grains = run.Fill({.low = {m - 0.5 * silo.width, silo.flat ? m : m - 0.5 * silo.width, 0},
                             .width = silo.width,
                             .depth = silo.flat ? 0 : silo.width,
                             .height = own ? BoundsOf(vessel).high.z : 0,
                             .holds =
                                 [&](const Vec3& c, double r) {
                                   if (own) {
                                     return interior.Holds(c, r);
                                   }
                                   return silo.flat ? std::abs(c.x - m) + r < 0.5 * silo.width
                                                    : Hypotenuse(c.x - m, c.y - m) + r < inner;
                                 }},
                            run.seed());
  if (own && run.CountOf(grains) < run.radii().size()) {
    return run.Fail(absl::StrCat("mesh silo is too small: of ", run.radii().size(), " grains ",
                                 run.CountOf(grains), " find room, poured loosely"));
  }
  if (run.CountOf(grains) < run.radii().size()) {
    return run.Fail("silo_width is too small: no grain fits into the silo");
  }
  const double top = TopOf(grains);
  grains.length[0] = silo.width + 2 * d;
  grains.length[1] = silo.flat ? d : grains.length[0];  // one cell deep for searches
  grains.length[2] = top;
  Surroundings walls{.planar = silo.flat, .thickness = run.Setting("thickness")};
  walls.walls.push_back(MakePlane("floor", {0, 0, 0}, {0, 0, 1}));
  if (silo.flat) {
    walls.walls.push_back(MakePlane("left", {m - 0.5 * silo.width, m, 0}, {1, 0, 0}));
    walls.walls.push_back(MakePlane("right", {m + 0.5 * silo.width, m, 0}, {-1, 0, 0}));
  } else if (own) {
    walls.walls.push_back(MakeMeshWall("silo", vessel));
  } else {
    TriangleMesh side;
    AddFrustum({.centre = {m, m, -d},
                .height = top + 20 * d,
                .lower_radius = 0.5 * silo.width,
                .upper_radius = 0.5 * silo.width,
                .sides = kSides},
               side);
    walls.walls.push_back(MakeMeshWall("cylinder", side));
  }
  Assembly assembly = run.MakeAssembly(grains, std::move(walls));
  const double far = silo.width + top;
  const FlowOptions options{
      .drop_height = top, .low = {-far, -far, -far}, .high = {2 * far, 2 * far, 3 * far}};
  return run.WalkFrom(assembly, options, run.LongestSettling(top), [&](const ControlPoint& point) {
    return Discharge(run, silo, assembly, options, point);
  });
}

std::vector<std::string> Problems(const Scenario& scenario) {
  if (GivenSetting(scenario, "thickness") > 0 && GivenSetting(scenario, "flat") < 0.5) {
    return {"thickness makes disks, which need a plane: set flat: 1, or leave thickness out"};
  }
  return {};
}

/// Of outlets only the first that is too large, and the first that is too small.
GrainRemarks Remarks(const Scenario& scenario, const GrainSizes& grains) {
  const bool flat = GivenSetting(scenario, "flat") >= 0.5;
  const auto vessel = scenario.meshes.find("silo");
  const double width =
      vessel != scenario.meshes.end()
          ? WidthOf(vessel->second)
          : GivenSetting(scenario, "silo_width", ChosenWidth(flat, grains.mean_diameter()));
  const double thinnest = grains.thickness * grains.smallest_diameter();
  GrainRemarks remarks;
  const auto first = [&scenario](const auto& is) {
    return std::find_if(scenario.path.begin(), scenario.path.end(),
                        [&is](const ControlPoint& point) { return is(point.target); });
  };
  if (const auto wide = first([&](double opening) { return opening >= width; });
      wide != scenario.path.end()) {
    remarks.refused.push_back(WideOutlet(wide->target, width));
  }
  if (const auto narrow = first([&](double opening) { return opening <= thinnest; });
      narrow != scenario.path.end()) {
    remarks.refused.push_back(absl::StrCat("opening ", narrow->target,
                                           " m is not wider than the smallest grain, ", thinnest,
                                           " m: nothing flows out"));
  }
  if (std::string problem = NarrowProblem(scenario, {.setting = "silo_width",
                                                     .grains = "the largest grain",
                                                     .least = grains.largest_diameter(),
                                                     .why = "it does not fit into the silo"});
      !problem.empty()) {
    remarks.refused.push_back(std::move(problem));
  }
  return remarks;
}

}  // namespace

TestEntry SiloDischarge() {
  return {
      .info =
          {.name = "silo_discharge",
           .description =
               "Grains are poured into a silo with a level floor and come to rest; then an outlet "
               "opens in the middle. "
               "Control: the opening, each from the same filled silo. Where no grain leaves for "
               "jam_time while "
               "some stand above the outlet, an arch has formed: its lowest grain is taken out and "
               "set on top. "
               "Ends when the outlet has run empty, after `avalanches` arches or after `duration`. "
               "mass_flow_rate is the slope of the mass over the time of flow between 10 and 70 % "
               "of what left. An avalanche is what leaves until an arch forms, one or more grains; "
               "what leaves "
               "after the last arch belongs to none, and where no avalanche has ended "
               "(avalanche_count "
               "0) the sizes are all that left, a lower bound. "
               "Fails when a grain escapes",
           .settings = WithCommonSettings(
               {Whole("flat", {.value = 0, .min = 0, .max = 1},
                      "1: one plane of grains, x and z only, outlet a slot; 0: a cylinder, outlet "
                      "a circle"),
                ThicknessOfDisks(),
                Chosen("silo_width", "m",
                       "diameter, or width if flat; 0: twelve mean grain diameters, forty if flat"),
                Chosen("jam_time", "s",
                       "without a grain that tells an arch; 0: 20 sqrt(mean diameter / gravity)"),
                Whole("avalanches", {.value = 20, .min = 1, .max = 1e6},
                      "arches after which the test ends"),
                Chosen("duration", "s",
                       "longest time of discharge; 0: 400 sqrt(mean diameter / gravity)")}),
           .observables = {"opening", "mass_flow_rate", "discharged_mass", "avalanche_size", "jams",
                           "avalanche_count", "avalanche_median", "avalanche_p90"},
           .control = "opening",
           .may_reverse = true,
           .reference =
               "Hadjidoukas et al. 2014, sec. 5.3; Beverloo et al., Chem. Eng. Sci. 15 (1961) 260",
           .poured = true,
           .separate_points = true,
           .control_range = ControlRange{.min = 0, .max = 1000},
           .meshes = {{.name = "silo",
                       .description =
                           "replaces the cylinder (not with flat, nor with silo_width): a vessel "
                           "open at the top, whose cross-sections are such that every place within "
                           "sees wall along x and y in both directions, without holes in its "
                           "wall. Origin: the middle of the "
                           "outlet in the level floor, on which it stands; z upwards"}},
           .has_walls = true,
           .bodies = {"walls"}},
      .place = 70,
      .procedure = GravityProcedure(&Walk),
      .problems = &Problems,
      .grain_remarks = &Remarks};
}

}  // namespace calib::dem
