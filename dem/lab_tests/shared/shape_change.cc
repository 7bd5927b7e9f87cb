#include "dem/lab_tests/shared/shape_change.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "dem/contact/laws/linear.h"
#include "dem/dynamics/assembly.h"
#include "dem/elementary/functions.h"
#include "dem/neighbor/packing_overlap.h"
#include "dem/particles/elongation.h"

namespace calib::dem {
namespace {

/// Largest growth of the aspect at a time [-]. Chosen: grains overlap little before they give way.
constexpr double kAspectStep = 0.02;
/// Largest growth of a surface at a time, in radii [-]. Chosen as kAspectStep.
constexpr double kGrowth = 0.02;
/// Time steps in which grains give way after a growth, and after the last one [-]. Chosen; overlaps
/// left at the end are in dem/VERIFICATION.md, clumps and crushing.
constexpr int kStepsBetween = 200;
constexpr int kStepsAtTheEnd = 3000;
/// Time steps between two looks at stiffness [-]. Chosen as in dynamics/quasi_static.cc.
constexpr int kInspection = 20;
/// Local damping [-]. Chosen: grains come to rest within the steps above.
constexpr double kDamping = 0.5;
/// Coefficient of friction of growing dumbbells [-]. Chosen: without it the fabric of the spheres
/// would fall apart.
constexpr double kFriction = 0.5;
/// Density of the grains [kg/m^3]. Chosen: that of quartz; it sets the time scale only.
constexpr double kDensity = 2650;
/// Time step over the critical one [-]. Chosen: contacts stiffen between two looks.
constexpr double kSafety = 0.5;

ContactModel SoftGrains(double friction) {
  Model model;
  model.contact = "linear";
  model.density = kDensity;
  model.parameters = {
      {"young_modulus", 1e8}, {"poisson_ratio", 0.5}, {"friction_coefficient", friction}};
  const ContactEntry law = Linear();
  return ContactModel(model, {.law = &law});
}

/// Lets the grains push each other apart for a number of steps.
absl::Status Relax(Assembly& assembly, int steps, const std::stop_token& stop) {
  RETURN_IF_ERROR(assembly.EvaluateForces());
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
      RETURN_IF_ERROR(assembly.EstimateStiffness(estimate));
      const double nominal = assembly.NominalCriticalStep();
      dt = kSafety *
           (estimate.critical_step > 0 ? std::min(nominal, estimate.critical_step) : nominal);
    }
    assembly.Move({.dt = dt, .damping = kDamping});
    RETURN_IF_ERROR(assembly.EvaluateForces());
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

/// Takes the clumps where they have come to, with their mean centre in the cell, and gives them the
/// next size of their shape: arms times `stretch`, the radii of `shape`.
void Grow(const Assembly& assembly, const Packing& spheres, const ClumpTemplate& shape,
          double stretch, Packing& packing) {
  const std::size_t count = shape.spheres.size();
  const ParticleArrays& p = assembly.particles();
  std::array<std::vector<double>*, 3> places = {&packing.x, &packing.y, &packing.z};
  for (const Clump& clump : assembly.clumps().all()) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      double mean = 0;
      for (const auto& arm : clump.arm) {
        mean += arm[axis] / static_cast<double>(count);
      }
      const double length = packing.length[axis];
      const double middle = clump.centre[axis] + mean;
      const double wrapped = middle - std::floor(middle / length) * length;
      for (std::size_t s = 0; s < count; ++s) {
        const auto i = static_cast<std::size_t>(p.id[static_cast<std::size_t>(clump.members[s])]);
        (*places[axis])[i] = wrapped + stretch * (clump.arm[s][axis] - mean);
      }
    }
  }
  for (std::size_t i = 0; i < packing.radius.size(); ++i) {
    packing.radius[i] = spheres.radius[i / count] * shape.spheres[i % count].radius;
  }
}

/// Arms of one share of the shape over those of another, the same for all members.
double Stretch(const ClumpTemplate& from, const ClumpTemplate& to) {
  double old_arm = 0;
  double arm = 0;
  for (std::size_t s = 0; s < from.spheres.size(); ++s) {
    const auto& a = from.spheres[s].centre;
    const auto& b = to.spheres[s].centre;
    const double length = Hypotenuse(a[0], a[1], a[2]);
    if (length > old_arm) {
      old_arm = length;
      arm = Hypotenuse(b[0], b[1], b[2]);
    }
  }
  return arm / old_arm;
}

double LargestOverlap(const Assembly& assembly) {
  const ParticleArrays& p = assembly.particles();
  const NeighborList& list = assembly.neighbors();
  double largest = 0;
  for (int slot = 0; slot < list.size(); ++slot) {
    if (!assembly.touching(slot)) {
      continue;
    }
    const auto q = static_cast<std::size_t>(slot);
    const auto i = static_cast<std::size_t>(list.first[q]);
    const auto j = static_cast<std::size_t>(list.second[q]);
    const int code = list.image[q];
    const std::array<double, 3> apart = {p.x[j] - p.x[i], p.y[j] - p.y[i], p.z[j] - p.z[i]};
    const std::array<int, 3> shift = {code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1};
    const auto along = [&](std::size_t a) {
      return apart[a] + shift[a] * assembly.cell().length[a];
    };
    const double overlap = p.radius[i] + p.radius[j] - Hypotenuse(along(0), along(1), along(2));
    largest = std::max(largest, overlap / std::min(p.radius[i], p.radius[j]));
  }
  return largest;
}

/// Why spheres of this packing cannot become clumps of this shape; empty: they can.
std::string WhyNoClumps(const Packing& spheres, const ClumpTemplate& shape) {
  double largest = 0;
  for (std::size_t i = 0; i < spheres.x.size(); ++i) {
    if (spheres.clump[i] >= 0) {
      return absl::StrCat("grain ", i, " is part of clump ", spheres.clump[i],
                          " already: only single spheres become clumps");
    }
    largest = std::max(largest, spheres.radius[i]);
  }
  if (const auto deep = DeepOverlap(spheres)) {
    return absl::StrCat("grains ", deep->first, " and ", deep->second, " overlap by ",
                        deep->overlap, " m, more than half the smaller radius");
  }
  const double longest = 2 * ReachOf(shape) * largest;
  const double cell = *std::min_element(std::begin(spheres.length), std::end(spheres.length));
  return 2 * longest < cell ? ""
                            : absl::StrCat("the largest clump would be up to ", longest,
                                           " m long, and the cell of ", cell,
                                           " m must be longer than two of them");
}

}  // namespace

absl::StatusOr<ClumpPacking> MakeClumps(const Packing& spheres, const ClumpTemplate& shape,
                                        std::uint64_t seed, int threads, std::stop_token stop) {
  if (const std::string why = WhyNoClumps(spheres, shape); !why.empty()) {
    return absl::InvalidArgumentError(why);
  }
  const int stages =
      std::max(1, static_cast<int>(std::ceil((ReachOf(shape) - 1) / kGrowth - 1e-9)));
  const ContactModel model = SoftGrains(0);
  ClumpTemplate now = Between(shape, 1.0 / stages);
  ClumpPacking made{.packing = Replaced(spheres, now, seed)};
  for (int k = 1; k <= stages; ++k) {
    Assembly assembly(made.packing, kDensity, model, threads);
    const bool last = k == stages;
    if (auto s = Relax(assembly, last ? kStepsAtTheEnd : kStepsBetween, stop); !s.ok()) {
      return absl::Status(
          s.code(),
          absl::StrCat("at ", k, " of ", stages,
                       " steps from spheres to clumps: ", std::string(s.message()),
                       absl::IsOutOfRange(s)
                           ? "; clumps of this shape may need more room than this packing has"
                           : ""));
    }
    const ClumpTemplate next = last ? shape : Between(shape, static_cast<double>(k + 1) / stages);
    Grow(assembly, spheres, next, Stretch(now, next), made.packing);
    now = next;
    if (last) {
      const auto& length = made.packing.length;
      made.porosity = 1 - assembly.solid_volume() / (length[0] * length[1] * length[2]);
      made.largest_overlap = LargestOverlap(assembly);
    }
  }
  if (!spheres.material.empty()) {
    for (std::size_t i = 0; i < made.packing.x.size(); ++i) {
      made.packing.material.push_back(spheres.material[i / shape.spheres.size()]);
    }
  }
  return made;
}

absl::StatusOr<Packing> Elongate(const Packing& spheres, double aspect, int threads,
                                 std::stop_token stop) {
  const int stages = std::max(1, static_cast<int>(std::ceil((aspect - 1) / kAspectStep - 1e-9)));
  const ContactModel model = SoftGrains(kFriction);
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
