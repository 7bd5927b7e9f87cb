// A cloud, compressed isotropically, then friction lowered until the porosity holds.
// [Cheng 2018, sec. 2.2]
#include "dem/simulate/packing_generator.h"

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "dem/contact/laws/linear.h"
#include "dem/dynamics/quasi_static.h"
#include "dem/lab_tests/shared/consolidation.h"
#include "dem/particles/random_cloud.h"

namespace calib::dem {
namespace {

/// Solid fraction of the cloud [-]. Chosen: random sequential addition fills it quickly.
constexpr double kCloudFraction = 0.25;
/// Contact modulus over pressure [-]. Chosen: overlaps stay below a thousandth of a radius.
constexpr double kModulusOverPressure = 5e3;
/// Coefficient of friction during compression [-]. Chosen: it keeps the first packing loose.
constexpr double kInitialFriction = 1.0;
/// Local damping throughout [-]. Chosen: strong damping (0.9) would let the last rearrangements
/// creep.
constexpr double kDamping = 0.3;
/// Density of the grains [kg/m^3]. Chosen: that of quartz; it sets the time scale only.
constexpr double kDensity = 2650;
/// Inertial number of the compression [-]. Chosen: the cloud needs no quasi-static path, only a
/// quasi-static end.
constexpr double kInertialNumber = 1e-2;

bool IsCloud(const PackingRecipe& r) { return r.porosity >= kCloudPorosity && r.porosity < 1; }

std::vector<std::string> RecipeProblems(const PackingRecipe& r) {
  std::vector<std::string> problems;
  const auto check = [&](bool ok, const char* name, double value, const char* allowed) {
    if (!ok) {
      problems.push_back(absl::StrCat(name, " is ", value, ", allowed is ", allowed));
    }
  };
  check(r.particles >= 20 && r.particles <= 1'000'000, "particles", r.particles, "20 .. 1e6");
  check((r.porosity > 0.2 && r.porosity < 0.6) || IsCloud(r), "porosity", r.porosity,
        "(0.2, 0.6), of a cloud [0.7, 1)");
  check(r.mean_radius > 0 && std::isfinite(r.mean_radius), "mean_radius", r.mean_radius,
        "positive [m]");
  check(r.radius_spread >= 0 && r.radius_spread < 1, "radius_spread", r.radius_spread, "[0, 1)");
  check(r.aspect >= 0.2 && r.aspect <= 5, "aspect", r.aspect, "0.2 .. 5");
  check(r.depth_ratio >= 0.2 && r.depth_ratio <= 5, "depth_ratio", r.depth_ratio, "0.2 .. 5");
  check(r.pressure > 0 && std::isfinite(r.pressure), "pressure", r.pressure, "positive [Pa]");
  const auto given = static_cast<int>(r.radii.size());
  check(given == 0 || given == r.particles, "the number of radii", given, "that of particles");
  for (const double radius : r.radii) {
    check(radius > 0 && std::isfinite(radius), "a radius", radius, "positive [m]");
  }
  if (!r.grading.empty() && !IsGrading(r.grading)) {
    problems.emplace_back("grading is no curve that rises from 0 to 1");
  }
  return problems;
}

Packing PackingOf(const Assembly& assembly) {
  const ParticleArrays& p = assembly.particles();
  const std::size_t n = p.x.size();
  Packing packing;
  std::copy_n(assembly.cell().length, 3, packing.length);
  for (auto* a : {&packing.x, &packing.y, &packing.z, &packing.radius}) {
    a->resize(n);
  }
  packing.clump.assign(n, -1);
  const auto wrapped = [](double s, double length) { return s - std::floor(s / length) * length; };
  for (std::size_t k = 0; k < n; ++k) {
    const auto i = static_cast<std::size_t>(p.id[k]);
    packing.x[i] = wrapped(p.x[k], packing.length[0]);
    packing.y[i] = wrapped(p.y[k], packing.length[1]);
    packing.z[i] = wrapped(p.z[k], packing.length[2]);
    packing.radius[i] = p.radius[k];
  }
  return packing;
}

}  // namespace

absl::StatusOr<Packing> GenerateSizes(const PackingRecipe& recipe) {
  if (const auto problems = RecipeProblems(recipe); !problems.empty()) {
    return absl::InvalidArgumentError(absl::StrJoin(problems, "; "));
  }
  return RandomCloud(recipe, kCloudFraction);
}

absl::StatusOr<Packing> GeneratePacking(const PackingRecipe& recipe, int threads,
                                        std::stop_token stop) {
  if (const auto problems = RecipeProblems(recipe); !problems.empty()) {
    return absl::InvalidArgumentError(absl::StrJoin(problems, "; "));
  }
  if (IsCloud(recipe)) {
    return RandomCloud(recipe, 1 - recipe.porosity);
  }
  ASSIGN_OR_RETURN(const Packing cloud, RandomCloud(recipe, kCloudFraction));
  Model model;
  model.contact = "linear";
  model.density = kDensity;
  model.parameters = {{"young_modulus", kModulusOverPressure * recipe.pressure},
                      {"poisson_ratio", 0.5},
                      {"friction_coefficient", kInitialFriction}};
  const ContactEntry law = Linear();
  Assembly assembly(cloud, kDensity, ContactModel(model, {.law = &law}), threads);
  StageOptions options;
  options.rate = kInertialNumber / (2 * recipe.mean_radius) * std::sqrt(recipe.pressure / kDensity);
  options.damping_settling = kDamping;
  options.unbalanced = 1e-3;
  QuasiStatic stages(assembly, options, std::move(stop));
  const AxisTarget axis{.mode = AxisTarget::Mode::kStress, .value = recipe.pressure};
  StageEnd end = stages.MoveTo({{axis, axis, axis}});
  if (end == StageEnd::kDone) {
    RETURN_IF_ERROR(LowerFrictionToPorosity(recipe.porosity, recipe.pressure, stages, end));
  }
  if (end == StageEnd::kStopped) {
    return absl::CancelledError("packing generation was stopped");
  }
  if (end == StageEnd::kDiverged) {
    return absl::OutOfRangeError(absl::StrCat("packing generation: ", stages.reason()));
  }
  return PackingOf(assembly);
}

}  // namespace calib::dem
