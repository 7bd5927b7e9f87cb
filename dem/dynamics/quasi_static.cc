#include "dem/dynamics/quasi_static.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/elementary/functions.h"

namespace calib::dem {
namespace {

/// Steps between two looks at stiffness, balance and finiteness [-]. Chosen: what steps exceed the
/// bound by in between is in dem/DECISIONS.md, stiffness is looked at every 20 steps.
constexpr std::int64_t kInspection = 20;

/// Steps to the next look where stiffness has grown by more than the factor kGrowth since the last
/// one, as where grains come into contact all at once [-]. Chosen, as kInspection
/// (dem/DECISIONS.md, stiffness is looked at every 20 steps).
constexpr std::int64_t kSoon = 5;
constexpr double kGrowth = 1.25;

/// Largest rate of stress-controlled axes over that of a driven one [-]. Chosen: they may have to
/// move several times faster.
constexpr double kServoRateOverDriven = 10;

/// Relative error of a stress within which loading ends [-]. Chosen: settling then closes the rest.
constexpr double kLoadingTolerance = 1e-2;

/// Assembly::MomentDelay() from which on a settling that fails says so [-]. Chosen: below it
/// moments are not why it fails.
constexpr double kDelayToTell = 10;

/// Strain of an axis under a held stress from which on its cell is said to have collapsed [-].
/// Chosen: the words of a message hang on it, no result.
constexpr double kCollapse = 0.05;

/// Largest strain in one step where no stiffness limits the step yet [-]. Chosen: overlaps of new
/// contacts stay small.
constexpr double kMaxStrainPerStep = 1e-4;

bool Drives(const CellTarget& target, const PeriodicCell& cell) {
  for (std::size_t a = 0; a < 3; ++a) {
    if (target[a].mode == AxisTarget::Mode::kLength && target[a].value != cell.length[a]) {
      return true;
    }
  }
  return target.displacement != cell.displacement;
}

bool AllByStress(const CellTarget& target) {
  return std::all_of(target.begin(), target.end(),
                     [](const AxisTarget& t) { return t.mode == AxisTarget::Mode::kStress; });
}

/// Largest relative change of length, or shear strain, that is still to be driven.
double FurthestToGo(const CellTarget& target, const PeriodicCell& cell) {
  double furthest = std::abs(target.displacement - cell.displacement) / cell.length[2];
  for (std::size_t a = 0; a < 3; ++a) {
    if (target[a].mode == AxisTarget::Mode::kLength) {
      furthest = std::max(furthest, std::abs(target[a].value / cell.length[a] - 1.0));
    }
  }
  return furthest;
}

}  // namespace

void StrainingSpeed::Adapt(double unbalanced, double settled) {
  const double faster = unbalanced > 0 ? Pow(kTarget * settled / unbalanced, kGain) : kFastest;
  factor_ = std::clamp(factor_ * faster, 1.0, kFastest);
}

QuasiStatic::QuasiStatic(Assembly& assembly, const StageOptions& options, std::stop_token stop)
    : assembly_(&assembly), options_(options), stop_(std::move(stop)) {}

void QuasiStatic::InspectBeforeNextStep() { since_inspection_ = interval_; }

StageEnd QuasiStatic::Diverge(std::string reason) {
  reason_ = std::move(reason);
  return StageEnd::kDiverged;
}

StageEnd QuasiStatic::Begin() {
  if (begun_) {
    return StageEnd::kDone;
  }
  begun_ = true;
  if (auto s = assembly_->EvaluateForces(); !s.ok()) {
    return Diverge(std::string(s.message()));
  }
  const StageEnd end = Inspect();
  first_interval_ = true;
  return end;
}

/// Grains that barely touch are soft: a step judged by them is too long as soon as they overlap,
/// all of them at once in a lattice. Looked at before every step of the first interval; a step that
/// is stable stays what it is.
void QuasiStatic::GuardFirstSteps() {
  StiffnessEstimate estimate;
  if (assembly_->EstimateStiffness(estimate).ok() && dt_ > StableStep(estimate.fastest, damping_)) {
    Adopt(estimate);
  }
}

StageEnd QuasiStatic::Inspect() {
  since_inspection_ = 0;
  first_interval_ = false;
  if (std::string bad = assembly_->FirstNotFinite(); !bad.empty()) {
    return Diverge(std::move(bad));
  }
  if (intervention_) {
    if (auto s = intervention_(*assembly_); !s.ok()) {
      return Diverge(std::string(s.message()));
    }
  }
  if (straining_ && options_.adaptive) {
    speed_.Adapt(assembly_->UnbalancedForce(), options_.unbalanced);
  }
  StiffnessEstimate estimate;
  if (auto s = assembly_->EstimateStiffness(estimate); !s.ok()) {
    return Diverge(std::string(s.message()));
  }
  const double delay = assembly_->MomentDelay(estimate);
  moment_text_ = delay > kDelayToTell ? assembly_->MomentStepText(estimate) : "";
  if (delay > Assembly::kLongestMomentDelay) {
    return Diverge(moment_text_);
  }
  Adopt(estimate);
  return StageEnd::kDone;
}

void QuasiStatic::Adopt(const StiffnessEstimate& estimate) {
  interval_ = estimate.fastest.spring > kGrowth * stiffness_.spring ? kSoon : kInspection;
  stiffness_ = estimate.fastest;
  elastic_modulus_ = estimate.modulus;
  viscosity_ = estimate.viscosity;
  ChooseStep();
}

/// Local damping makes forces larger where they slow grains down, and the largest stable step
/// shorter.
void QuasiStatic::SetDamping(double damping) {
  if (damping != damping_) {
    damping_ = damping;
    ChooseStep();
  }
}

void QuasiStatic::ChooseStep() {
  dt_ = options_.step_share * std::min({kMaxStrainPerStep / (options_.rate * speed_.factor()),
                                        StableStep(assembly_->NominalRates(), damping_),
                                        StableStep(stiffness_, damping_)});
  for (std::size_t a = 0; a < 3; ++a) {
    // A dashpot answers a strain rate at once, in the same step: the servo must see it as
    // stiffness.
    modulus_[a] = elastic_modulus_[a] + 2.0 * viscosity_[a] / dt_;
  }
}

/// A cell that a held stress makes too short for its periodic images is a specimen that yields
/// without end; of one that is driven there the length itself is what is wrong.
std::string QuasiStatic::WhyNoForces(const CellTarget& target, const std::string& problem) const {
  const double* const length = assembly_->cell().length;
  const auto shortest = static_cast<std::size_t>(std::min_element(length, length + 3) - length);
  const double strain = Log(stage_length_[shortest] / length[shortest]);
  if (target[shortest].mode != AxisTarget::Mode::kStress || !(strain > kCollapse) ||
      !assembly_->FirstNotFinite().empty()) {
    return problem;
  }
  const auto held = [&target](std::size_t a, const char* name) {
    return target[a].mode == AxisTarget::Mode::kStress
               ? absl::StrCat(name, " ", target[a].value, " Pa")
               : std::string();
  };
  const std::string axial = held(2, "axial");
  const std::string lateral = held(shortest == 1 ? 1 : 0, "lateral");
  return absl::StrCat("the specimen collapses under ", axial,
                      axial.empty() || lateral.empty() ? "" : ", ", lateral, ": strain ", strain,
                      " along ", std::string(1, "xyz"[shortest]), " in this stage; ", problem);
}

bool QuasiStatic::StressesWithin(const CellTarget& target, double tolerance) const {
  for (std::size_t a = 0; a < 3; ++a) {
    if (target[a].mode == AxisTarget::Mode::kStress &&
        !(std::abs(assembly_->stress()[a] - target[a].value) <= tolerance * target[a].value)) {
      return false;
    }
  }
  return true;
}

double QuasiStatic::Rate(const CellTarget& target) const {
  return AllByStress(target) ? options_.rate : options_.rate * speed_.factor();
}

double QuasiStatic::MaxServoRate(const CellTarget& target) const {
  return AllByStress(target) ? options_.rate : kServoRateOverDriven * Rate(target);
}

StageEnd QuasiStatic::Step(const CellTarget& target, double damping) {
  if (stop_.stop_requested()) {
    return StageEnd::kStopped;
  }
  if (since_inspection_ >= interval_) {
    if (const StageEnd end = Inspect(); end != StageEnd::kDone) {
      return end;
    }
  }
  SetDamping(damping);
  const PeriodicCell& cell = assembly_->cell();
  Motion motion{.stretch = {0, 0, 0}, .dt = dt_, .damping = damping};
  bool reached[3] = {false, false, false};
  const double furthest = FurthestToGo(target, cell);
  const double rate = Rate(target);
  const double max_servo_rate = MaxServoRate(target);
  for (std::size_t a = 0; a < 3; ++a) {
    if (target[a].mode == AxisTarget::Mode::kStress) {
      motion.stretch[a] = -servo_[a].Update({.error = target[a].value - assembly_->stress()[a],
                                             .modulus = modulus_[a],
                                             .dt = dt_,
                                             .max_rate = max_servo_rate});
      continue;
    }
    const double remaining = target[a].value / cell.length[a] - 1.0;
    // Axes driven together arrive together: rate is that of the one with the furthest to go.
    const double share = furthest > 0 ? std::abs(remaining) / furthest : 1.0;
    const double largest = rate * dt_ * share;
    reached[a] = std::abs(remaining) <= largest;
    motion.stretch[a] = std::clamp(remaining, -largest, largest) / dt_;
  }
  const double shear = (target.displacement - cell.displacement) / cell.length[2];
  const double shear_limit = rate * dt_ * (furthest > 0 ? std::abs(shear) / furthest : 1.0);
  const bool sheared = std::abs(shear) <= shear_limit;
  motion.shear = std::clamp(shear, -shear_limit, shear_limit) / dt_ -
                 motion.stretch[0] * cell.displacement / cell.length[2];
  assembly_->Move(motion);
  for (std::size_t a = 0; a < 3; ++a) {
    if (reached[a]) {  // the last step ends at the target exactly, without rounding
      assembly_->SetLength(static_cast<int>(a), target[a].value);
    }
  }
  if (sheared) {
    assembly_->SetDisplacement(target.displacement);
  }
  if (auto s = assembly_->EvaluateForces(); !s.ok()) {
    return Diverge(WhyNoForces(target, std::string(s.message())));
  }
  if (++since_inspection_ >= interval_) {
    return Inspect();
  }
  if (first_interval_) {
    GuardFirstSteps();
  }
  return StageEnd::kDone;
}

CellTarget QuasiStatic::Current(const CellTarget& asked, FollowGap& gap) const {
  CellTarget target = asked;
  gap = follow_ ? follow_(modulus_, target) : FollowGap{};
  return target;
}

StageEnd QuasiStatic::Load(const CellTarget& asked) {
  FollowGap gap;
  CellTarget target = Current(asked, gap);
  const bool by_length = Drives(target, assembly_->cell());
  straining_ = !AllByStress(target);
  for (std::int64_t step = 0; step < options_.max_loading_steps; ++step) {
    target = Current(asked, gap);
    // A followed strain is there within one step; its settling closes the rest.
    const bool there = follow_     ? gap.strain <= Rate(target) * dt_
                       : by_length ? !Drives(target, assembly_->cell())
                                   : StressesWithin(target, kLoadingTolerance);
    if (there) {
      straining_ = false;
      return StageEnd::kDone;
    }
    if (const StageEnd end = Step(target, options_.damping_loading); end != StageEnd::kDone) {
      return end;
    }
  }
  return Diverge(absl::StrCat("loading did not reach its target within ",
                              options_.max_loading_steps, " steps"));
}

StageEnd QuasiStatic::Settle(const CellTarget& asked) {
  if (const StageEnd end = Begin(); end != StageEnd::kDone) {
    return end;
  }
  for (StressServo& servo : servo_) {
    servo.Forget();
  }
  FollowGap gap;
  CellTarget target = Current(asked, gap);
  double unbalanced = 0;
  for (std::int64_t step = 0; step <= options_.max_settling_steps; ++step) {
    if (assembly_->cell().Volume() <= options_.least_volume) {
      return StageEnd::kDone;
    }
    target = Current(asked, gap);
    if (step > 0 && step % kInspection == 0) {  // a change of friction shows after some steps only
      unbalanced = assembly_->UnbalancedForce();
      if (unbalanced < options_.unbalanced && gap.tolerances <= 1 &&
          StressesWithin(target, options_.stress_tolerance)) {
        return StageEnd::kDone;
      }
    }
    if (const StageEnd end = Step(target, options_.damping_settling); end != StageEnd::kDone) {
      return end;
    }
  }
  const auto& stress = assembly_->stress();
  return Diverge(absl::StrCat("the specimen did not settle within ", options_.max_settling_steps,
                              " steps: unbalanced force ", unbalanced, " (limit ",
                              options_.unbalanced, "), stresses ", stress[0], " ", stress[1], " ",
                              stress[2], " Pa", moment_text_.empty() ? "" : "; ", moment_text_));
}

StageEnd QuasiStatic::MoveTo(const CellTarget& target) {
  const StageEnd end = MoveThrough(target);
  return end == StageEnd::kDone ? Settle(target) : end;
}

StageEnd QuasiStatic::MoveThrough(const CellTarget& target) {
  std::copy_n(assembly_->cell().length, 3, stage_length_.begin());
  if (const StageEnd end = Begin(); end != StageEnd::kDone) {
    return end;
  }
  return Load(target);
}

}  // namespace calib::dem
