#include "dem/lab_tests/shared/consolidation.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "dem/elementary/functions.h"
#include "dem/measure/observables.h"

namespace calib::dem {
namespace {

/// Coefficient of friction below which it counts as 0 [-]. Chosen: a pack without friction is still
/// a solid, and below this nothing changes any more.
constexpr double kSmallestFriction = 1e-3;

CellTarget Isotropic(double pressure) {
  const AxisTarget target{.mode = AxisTarget::Mode::kStress, .value = pressure};
  return {{target, target, target}};
}

/// 1-2-5 x 10^k in [pressure/20, pressure), then the pressure itself.
std::vector<double> PressureStages(double pressure) {
  std::vector<double> stages;
  const int decade = static_cast<int>(std::floor(Log(pressure) / std::numbers::ln10));
  for (int k = decade - 2; k <= decade + 1; ++k) {
    for (const double digit : {1.0, 2.0, 5.0}) {
      const double stage = digit * Pow(10.0, k);
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

/// Compaction at constant isotropic pressure by lowering friction, and what stops it.
class Compaction {
 public:
  Compaction(double pressure, QuasiStatic& stages)
      : target_(Isotropic(pressure)),
        stages_(stages),
        friction_(stages.assembly().sliding_friction()),
        lowered_(friction_) {}

  /// Multiplies friction by `factor` again and again, settling roughly in between, until the
  /// porosity is at most `threshold` or friction has gone. Starts one such step above where the
  /// last call ended. The assembly keeps the lowered friction.
  StageEnd LowerTo(double threshold, double factor) {
    Assembly& assembly = stages_.assembly();
    const StageOptions restore = stages_.options();
    stages_.options().unbalanced = kIntermediate * restore.unbalanced;
    stages_.options().least_volume = assembly.solid_volume() / (1 - threshold);
    assembly.SetSlidingFriction(std::min(friction_, lowered_ / factor));
    StageEnd end = StageEnd::kDone;
    while (end == StageEnd::kDone && Porosity(assembly) > threshold &&
           assembly.sliding_friction() > 0) {
      const double lower = factor * assembly.sliding_friction();
      assembly.SetSlidingFriction(lower > kSmallestFriction ? lower : 0.0);
      end = stages_.MoveTo(target_);
    }
    lowered_ = std::max(assembly.sliding_friction(), kSmallestFriction);
    stages_.options() = restore;
    return end;
  }

  /// Puts the original friction back and settles.
  StageEnd Freeze() {
    stages_.assembly().SetSlidingFriction(friction_);
    return stages_.MoveTo(target_);
  }

  /// Settles without friction: the densest state of this way.
  StageEnd Densest() {
    stages_.assembly().SetSlidingFriction(0);
    return stages_.MoveTo(target_);
  }

 private:
  /// Unbalanced force that ends a settling between two reductions, over StageOptions::unbalanced
  /// [-]. Chosen: there a rough balance is enough.
  static constexpr double kIntermediate = 10;

  CellTarget target_;
  QuasiStatic& stages_;
  double friction_;  ///< that the assembly came with
  double lowered_;   ///< where the last LowerTo ended
};

}  // namespace

absl::Status LowerFrictionToPorosity(double porosity, double pressure, QuasiStatic& stages,
                                     StageEnd& end) {
  constexpr int kAttempts = 60;  // [-], chosen: a bound; it ends where a small packing jumps
  Assembly& assembly = stages.assembly();
  const double highest = Porosity(assembly);
  Compaction compaction(pressure, stages);
  Assembly above = assembly;    // the densest frozen state so far that is not too dense
  double threshold = porosity;  // porosity at which compaction is stopped; it goes on a little
  double factor = 0.5;
  bool passed = highest >= porosity - kPorosityTolerance;
  end = StageEnd::kDone;
  for (int attempt = 0; passed && attempt < kAttempts; ++attempt) {
    const double settled = Porosity(assembly);
    if (std::abs(settled - porosity) <= kPorosityTolerance) {
      return absl::OkStatus();
    }
    if (settled > porosity && settled < Porosity(above)) {
      above = assembly;
      threshold = porosity;
    } else if (settled < porosity) {  // too far: stop earlier, and go more gently
      threshold = std::min(threshold + (porosity - settled), 0.5 * (threshold + Porosity(above)));
      factor = std::min(std::sqrt(factor), 0.97);
      assembly = above;
    }
    end = compaction.LowerTo(threshold, factor);
    passed = Porosity(assembly) <= threshold;
    if (end == StageEnd::kDone && passed) {
      end = compaction.Freeze();
    }
    if (end != StageEnd::kDone) {
      return absl::OkStatus();
    }
  }
  if (passed) {
    return absl::OutOfRangeError(absl::StrCat("porosity ", porosity,
                                              " cannot be met: the packing jumps from ",
                                              Porosity(above), " to ", Porosity(assembly)));
  }
  end = compaction.Densest();
  if (end != StageEnd::kDone) {
    return absl::OkStatus();
  }
  return Unreachable(porosity, Porosity(assembly), highest);
}

namespace {

CellTarget PreparedUnder(double pressure, double anisotropy) {
  CellTarget target = Isotropic(pressure);
  if (anisotropy != 0) {
    target[0].value = target[1].value = pressure * (1.0 - anisotropy / 3.0);
    target[2].value = pressure * (1.0 + anisotropy * 2.0 / 3.0);
  }
  return target;
}

/// Compresses through the pressure stages with the friction that the assembly has.
StageEnd Compress(const ConsolidationPlan& plan, QuasiStatic& stages) {
  StageEnd end = StageEnd::kDone;
  for (const double pressure : PressureStages(plan.pressure)) {
    end = stages.MoveTo(PreparedUnder(pressure, plan.preparation.stress_anisotropy));
    if (end != StageEnd::kDone) {
      return end;
    }
  }
  return plan.preparation.stress_anisotropy != 0 ? stages.MoveTo(Isotropic(plan.pressure)) : end;
}

/// Porosity to reach after compression, or nothing where it is left as it comes.
std::optional<double> PorosityToReach(const ConsolidationPlan& plan, const Assembly& compressed) {
  const double densification = plan.preparation.densification;
  if (densification == 0) {
    return plan.consolidation.porosity;
  }
  return plan.consolidation.porosity.value_or(Porosity(compressed)) - densification;
}

/// With the model's own friction to the stress at which loading begins.
StageEnd MoveToStart(const ConsolidationPlan& plan, double own_friction, QuasiStatic& stages) {
  CellTarget target = Isotropic(plan.pressure);
  if (plan.initial_stress) {
    target[0].value = target[1].value = plan.initial_stress->lateral;
    target[2].value = plan.initial_stress->axial;
  }
  stages.assembly().SetSlidingFriction(own_friction);
  return stages.MoveTo(target);
}

/// Lowers friction to a porosity from which the initial stress leads to the one asked for: the
/// first guess is that one itself, each further one corrected by what the last came out wrong.
absl::Status ReachPorosityAtStart(const ConsolidationPlan& plan, double porosity,
                                  double own_friction, QuasiStatic& stages, StageEnd& end) {
  constexpr int kAttempts = 10;  // [-], chosen: a bound for a search by secants
  Assembly& assembly = stages.assembly();
  const Assembly compressed = assembly;
  const double loosest = Porosity(compressed);
  const auto cannot = [&plan, porosity](const auto&... why) {
    return absl::OutOfRangeError(absl::StrCat("porosity ", porosity,
                                              " cannot be met at the initial stress (axial ",
                                              plan.initial_stress->axial, " Pa, lateral ",
                                              plan.initial_stress->lateral, " Pa): ", why...));
  };
  double before = porosity;  // at the isotropic pressure
  double reached = 0;
  double last_before = 0;
  double last_reached = 0;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    if (attempt > 0) {
      assembly = compressed;
    }
    if (auto s = LowerFrictionToPorosity(before, plan.pressure, stages, end); !s.ok()) {
      if (attempt == 0) {
        return cannot(std::string(s.message()));
      }
      return cannot("from ", last_before, " at the confining pressure it comes to ", last_reached,
                    ", and ", std::string(s.message()));
    }
    if (end == StageEnd::kDone) {
      end = MoveToStart(plan, own_friction, stages);
    }
    reached = Porosity(assembly);
    if (end != StageEnd::kDone || std::abs(reached - porosity) <= kPorosityTolerance) {
      return absl::OkStatus();
    }
    double slope = attempt > 0 ? (before - last_before) / (reached - last_reached) : 1.0;
    slope = slope > 0.5 && slope < 2.0 ? slope : 1.0;  // small steps are noise of the tolerance
    last_before = before;
    last_reached = reached;
    before += slope * (porosity - reached);
    if (before > loosest && last_before < loosest - kPorosityTolerance) {
      before = loosest;
    }
  }
  return cannot("after ", kAttempts, " attempts it is ", reached);
}

}  // namespace

absl::Status Consolidate(const ConsolidationPlan& plan, QuasiStatic& stages, StageEnd& end) {
  Assembly& assembly = stages.assembly();
  const double own_friction = assembly.model().sliding_friction();
  if (plan.consolidation.friction_coefficient) {
    assembly.SetSlidingFriction(*plan.consolidation.friction_coefficient);
  }
  std::optional<Assembly> start;
  if (plan.preparation.densification < 0 && assembly.sliding_friction() < own_friction) {
    start = assembly;  // looser than with lowered friction: begin again with the model's own
  }
  end = Compress(plan, stages);
  if (end != StageEnd::kDone) {
    return absl::OkStatus();
  }
  if (const auto porosity = PorosityToReach(plan, assembly)) {
    if (start && Porosity(assembly) < *porosity) {
      assembly = *start;
      assembly.SetSlidingFriction(own_friction);
      RETURN_IF_ERROR(assembly.EvaluateForces());
      end = Compress(plan, stages);
      if (end != StageEnd::kDone) {
        return absl::OkStatus();
      }
    }
    if (plan.initial_stress && plan.consolidation.porosity) {
      return ReachPorosityAtStart(plan, *porosity, own_friction, stages, end);
    }
    RETURN_IF_ERROR(LowerFrictionToPorosity(*porosity, plan.pressure, stages, end));
    if (end != StageEnd::kDone) {
      return absl::OkStatus();
    }
  }
  end = MoveToStart(plan, own_friction, stages);
  return absl::OkStatus();
}

}  // namespace calib::dem
