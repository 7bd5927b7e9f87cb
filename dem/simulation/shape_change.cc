#include "dem/simulation/shape_change.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "absl/strings/str_cat.h"
#include "dem/contact/contact_model.h"
#include "dem/dynamics/assembly.h"
#include "dem/elementary/functions.h"
#include "dem/particles/elongation.h"

namespace calib::dem {
namespace {

constexpr double kAspectStep = 0.02;
constexpr int kStepsBetween = 200;  ///< to give way after a small growth
constexpr int kStepsAtTheEnd = 3000;
constexpr int kInspection = 20;
constexpr double kDamping = 0.5;
constexpr double kFriction = 0.5;  ///< without it the fabric of the spheres would fall apart
constexpr double kDensity = 2650;
constexpr double kSafety = 0.5;  ///< of the critical step

Model SoftGrains() {
  Model model;
  model.contact = "linear";
  model.density = kDensity;
  model.parameters = {
      {"young_modulus", 1e8}, {"poisson_ratio", 0.5}, {"friction_coefficient", kFriction}};
  return model;
}

/// Lets the grains push each other apart for a number of steps.
absl::Status Relax(Assembly& assembly, int steps, const std::stop_token& stop) {
  if (auto s = assembly.EvaluateForces(); !s.ok()) {
    return s;
  }
  double dt = 0;
  for (int step = 0; step < steps; ++step) {
    if (stop.stop_requested()) {
      return absl::CancelledError("the change of shape was stopped");
    }
    if (step % kInspection == 0) {
      if (std::string bad = assembly.FirstNotFinite(); !bad.empty()) {
        return absl::OutOfRangeError(bad);
      }
      StiffnessEstimate estimate;
      if (auto s = assembly.EstimateStiffness(estimate); !s.ok()) {
        return s;
      }
      const double nominal = assembly.NominalCriticalStep();
      dt = kSafety *
           (estimate.critical_step > 0 ? std::min(nominal, estimate.critical_step) : nominal);
    }
    assembly.Move({.dt = dt, .damping = kDamping});
    if (auto s = assembly.EvaluateForces(); !s.ok()) {
      return s;
    }
  }
  return absl::OkStatus();
}

/// Sets both members of every clump to the shape of an aspect along their present axis; `spheres`
/// says how large each is.
void Reshape(const Assembly& assembly, const Packing& spheres, double aspect, Packing& packing) {
  const Dumbbell shape = DumbbellOf(aspect);
  const ParticleArrays& p = assembly.particles();
  for (const Clump& clump : assembly.clumps().all()) {
    const double length = Hypotenuse(clump.arm[0][0], clump.arm[0][1], clump.arm[0][2]);
    for (std::size_t s = 0; s < 2; ++s) {
      const auto i = static_cast<std::size_t>(p.id[static_cast<std::size_t>(clump.members[s])]);
      const double radius = spheres.radius[i / 2];  // members of sphere i are 2i and 2i + 1
      const double scale = shape.offset * radius / length;
      packing.x[i] = clump.centre[0] + scale * clump.arm[s][0];
      packing.y[i] = clump.centre[1] + scale * clump.arm[s][1];
      packing.z[i] = clump.centre[2] + scale * clump.arm[s][2];
      packing.radius[i] = shape.radius * radius;
    }
  }
}

/// The whole body moved into the cell.
void WrapBodies(Packing& packing) {
  const auto into = [](std::vector<double>& x, double length) {
    for (std::size_t i = 0; i + 1 < x.size(); i += 2) {
      const double turns = std::floor(0.5 * (x[i] + x[i + 1]) / length) * length;
      x[i] -= turns;
      x[i + 1] -= turns;
    }
  };
  into(packing.x, packing.length[0]);
  into(packing.y, packing.length[1]);
  into(packing.z, packing.length[2]);
}

}  // namespace

absl::StatusOr<Packing> Elongate(const Packing& spheres, double aspect, int threads,
                                 std::stop_token stop) {
  const int stages = std::max(1, static_cast<int>(std::ceil((aspect - 1) / kAspectStep - 1e-9)));
  const ContactModel model(SoftGrains());
  Packing packing = Elongated(spheres, 1 + (aspect - 1) / stages);
  for (int k = 1; k <= stages; ++k) {
    Assembly assembly(packing, kDensity, model, threads);
    const bool last = k == stages;
    if (auto s = Relax(assembly, last ? kStepsAtTheEnd : kStepsBetween, stop); !s.ok()) {
      return absl::Status(s.code(), absl::StrCat("change of shape to aspect ", aspect, ": ",
                                                 std::string(s.message())));
    }
    Reshape(assembly, spheres, 1 + (aspect - 1) * std::min(k + 1, stages) / stages, packing);
    WrapBodies(packing);
  }
  return packing;
}

}  // namespace calib::dem
