#include "dem/simulation/consolidation.h"

#include <cmath>
#include <vector>

#include "absl/strings/str_cat.h"
#include "dem/measure/observables.h"

namespace calib::dem {
namespace {

/// A grain pack without friction is still a solid; below this coefficient nothing changes any more.
constexpr double kSmallestFriction = 1e-3;

CellTarget Isotropic(double pressure) {
  const AxisTarget target{.mode = AxisTarget::Mode::kStress, .value = pressure};
  return {target, target, target};
}

/// 1-2-5 x 10^k in [pressure/20, pressure), then the pressure itself.
std::vector<double> PressureStages(double pressure) {
  std::vector<double> stages;
  const int decade = static_cast<int>(std::floor(std::log10(pressure)));
  for (int k = decade - 2; k <= decade; ++k) {
    for (const double digit : {1.0, 2.0, 5.0}) {
      const double stage = digit * std::pow(10.0, k);
      if (stage >= 0.05 * pressure * (1 - 1e-9) && stage < pressure * (1 - 1e-9)) {
        stages.push_back(stage);
      }
    }
  }
  stages.push_back(pressure);
  return stages;
}

absl::Status Unreachable(double porosity, double lowest, double highest) {
  return absl::OutOfRangeError(
      absl::StrCat("porosity ", porosity, " cannot be reached by lowering friction; attainable is ",
                   lowest, " .. ", highest));
}

}  // namespace

absl::Status LowerFrictionToPorosity(double porosity, double pressure, QuasiStatic& stages,
                                     StageEnd& end) {
  const CellTarget target = Isotropic(pressure);
  Assembly& assembly = stages.assembly();
  const double highest = Porosity(assembly);
  end = StageEnd::kDone;
  if (porosity > highest + kPorosityTolerance) {
    // The lower end of the range is found by removing friction altogether.
    assembly.SetSlidingFriction(0);
    end = stages.MoveTo(target);
    return end == StageEnd::kDone ? Unreachable(porosity, Porosity(assembly), highest)
                                  : absl::OkStatus();
  }
  double factor = 0.8;
  while (Porosity(assembly) > porosity + kPorosityTolerance) {
    const double friction = assembly.sliding_friction();
    if (friction == 0) {
      return Unreachable(porosity, Porosity(assembly), highest);
    }
    const Assembly snapshot = assembly;
    assembly.SetSlidingFriction(friction * factor > kSmallestFriction ? friction * factor : 0.0);
    end = stages.MoveTo(target);
    if (end != StageEnd::kDone) {
      return absl::OkStatus();
    }
    if (Porosity(assembly) < porosity - kPorosityTolerance) {
      assembly = snapshot;
      factor = std::sqrt(factor);
      if (factor >
          1 - 1e-6) {  // one rearrangement jumps over the target: the nearest state below it stands
        assembly.SetSlidingFriction(friction * factor);
        end = stages.MoveTo(target);
        return absl::OkStatus();
      }
    }
  }
  return absl::OkStatus();
}

absl::Status Consolidate(const ConsolidationPlan& plan, QuasiStatic& stages, StageEnd& end) {
  Assembly& assembly = stages.assembly();
  if (plan.consolidation.friction_coefficient) {
    assembly.SetSlidingFriction(*plan.consolidation.friction_coefficient);
  }
  for (const double pressure : PressureStages(plan.pressure)) {
    end = stages.MoveTo(Isotropic(pressure));
    if (end != StageEnd::kDone) {
      return absl::OkStatus();
    }
  }
  if (plan.consolidation.porosity) {
    if (auto s = LowerFrictionToPorosity(*plan.consolidation.porosity, plan.pressure, stages, end);
        !s.ok()) {
      return s;
    }
    if (end != StageEnd::kDone) {
      return absl::OkStatus();
    }
  }
  CellTarget target = Isotropic(plan.pressure);
  if (plan.initial_stress) {
    target[0].value = target[1].value = plan.initial_stress->lateral;
    target[2].value = plan.initial_stress->axial;
  }
  assembly.SetSlidingFriction(assembly.model().sliding_friction());
  end = stages.MoveTo(target);
  return absl::OkStatus();
}

}  // namespace calib::dem
