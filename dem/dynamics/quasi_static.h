#pragma once
// Quasi-static motion of one specimen: strain or load the cell, then let the grains come to rest.

#include <array>
#include <cstdint>
#include <functional>
#include <stop_token>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "dem/dynamics/assembly.h"
#include "dem/dynamics/stress_servo.h"

namespace calib::dem {

/// Goal of one axis: a cell length to reach exactly, or a stress to hold.
struct AxisTarget {
  enum class Mode { kLength, kStress };
  Mode mode = Mode::kLength;
  double value = 0;  ///< [m] or [Pa]
};

/// Goals of the axes x, y, z and the displacement of the top along x to reach exactly [m].
struct CellTarget : std::array<AxisTarget, 3> {
  double displacement = 0;
};

/// How stages are walked.
struct StageOptions {
  double rate = 0.1;  ///< logarithmic strain rate of the driven axes, or shear rate [1/s] > 0
  double damping_loading = 0.2;   ///< local damping while moving [-], 0 .. 1
  double damping_settling = 0.9;  ///< while settling [-], 0 .. 1
  double unbalanced =
      5e-4;  ///< mean unbalanced over mean contact force that ends a settling [-] > 0
  double stress_tolerance =
      1e-3;                 ///< relative error of held stresses at the end of a settling [-] > 0
  double step_share = 0.9;  ///< time step over the largest that is stable with the damping of the
                            ///< moment (StableStep) [-], 0 .. 1
  double least_volume = 0;  ///< a settling ends where the cell has shrunk to this [m^3]
  bool adaptive = false;    ///< strained stages go faster than `rate` where forces stay balanced
  std::int64_t max_settling_steps = 200'000;  ///< a settling that takes longer has diverged
  std::int64_t max_loading_steps = 20'000'000;
};

/// A target that follows the specimen: looked at before every step. `target` is what was asked for
/// and becomes what to do now, given the affine stiffness of each axis [Pa]; the answer is how far
/// the stage is from its end, in tolerances (settled when at most one) and in strain still to go.
struct FollowGap {
  double tolerances = 0;  ///< >= 0
  double strain = 0;      ///< >= 0
};
using Follow = std::function<FollowGap(const std::array<double, 3>& modulus, CellTarget& target)>;

enum class StageEnd { kDone, kStopped, kDiverged };

/// Rate of strained stages over StageOptions::rate, chosen at every inspection while straining so
/// that the unbalanced force stays near kTarget times the one that ends a settling:
///   f <- min(kFastest, max(1, f (kTarget unbalanced / U)^kGain))
/// Elastic stages, which leave little unbalanced, go at several times the rate; where grains
/// rearrange it is the rate asked for. All-stress stages keep the rate.
class StrainingSpeed {
 public:
  /// U: mean unbalanced over mean contact force [-] >= 0; settled: StageOptions::unbalanced.
  void Adapt(double unbalanced, double settled);
  [[nodiscard]] double factor() const { return factor_; }

  template <class Archive>
  void Visit(Archive& archive) {
    archive(factor_);
  }

  static constexpr double kFastest = 8;

 private:
  static constexpr double kTarget = 2;
  static constexpr double kGain = 0.25;
  double factor_ = 1;
};

/// Drives an assembly. Between calls its forces are those of its present configuration. Looks at
/// the stop token every step.
class QuasiStatic {
 public:
  QuasiStatic(Assembly& assembly, const StageOptions& options, std::stop_token stop);

  /// Moves to the target with damping_loading, then settles.
  StageEnd MoveTo(const CellTarget& target);

  /// Moves to the target's lengths with damping_loading and returns at once: constant-rate loading.
  StageEnd MoveThrough(const CellTarget& target);

  /// Keeps lengths and held stresses with damping_settling until forces are balanced and stresses
  /// within tolerance.
  StageEnd Settle(const CellTarget& target);

  /// Lets every target from now on be followed; empty: targets are what they are.
  void SetFollow(Follow follow) { follow_ = std::move(follow); }

  /// Called at every inspection (20 steps); may change grains, as those that crush. An error ends
  /// the stage, with its message as the reason.
  void SetIntervention(std::function<absl::Status(Assembly&)> intervention) {
    intervention_ = std::move(intervention);
  }

  /// To be called when what contacts do has been changed from outside, as dashpots that begin to act:
  /// stiffness is looked at anew before the next step.
  void LookBeforeNextStep();

  [[nodiscard]] StageOptions& options() { return options_; }
  [[nodiscard]] Assembly& assembly() { return *assembly_; }
  [[nodiscard]] double time_step() const { return dt_; }

  /// For archives: all that options, follow and intervention do not bring with them.
  template <class Archive>
  void Visit(Archive& archive) {
    archive(servo_, stiffness_.spring, stiffness_.dashpot, elastic_modulus_, viscosity_, modulus_,
            damping_, dt_, since_inspection_, interval_, begun_);
    if (options_.adaptive) {
      archive(speed_);
    }
  }

  /// Why the last call returned kDiverged.
  [[nodiscard]] const std::string& reason() const { return reason_; }

 private:
  StageEnd Begin();
  StageEnd Load(const CellTarget& target);
  StageEnd Step(const CellTarget& target, double damping);
  StageEnd Inspect();
  void Adopt(const StiffnessEstimate& estimate);
  void SetDamping(double damping);
  void ChooseStep();
  void GuardFirstSteps();
  [[nodiscard]] std::string WhyNoForces(const CellTarget& target, const std::string& problem) const;
  StageEnd Diverge(std::string reason);
  [[nodiscard]] CellTarget Current(const CellTarget& asked, FollowGap& gap) const;
  [[nodiscard]] bool StressesWithin(const CellTarget& target, double tolerance) const;
  [[nodiscard]] double MaxServoRate(const CellTarget& target) const;
  [[nodiscard]] double Rate(const CellTarget& target) const;

  Assembly* assembly_;
  StageOptions options_;
  std::stop_token stop_;
  std::array<StressServo, 3> servo_;
  FastestRates stiffness_;                             ///< by the last inspection
  std::array<double, 3> elastic_modulus_ = {0, 0, 0};  ///< the same [Pa]
  std::array<double, 3> viscosity_ = {0, 0, 0};        ///< the same [Pa s]
  std::array<double, 3> modulus_ = {0, 0, 0};          ///< what servos see in steps of dt_ [Pa]
  double damping_ = 0;                                 ///< that dt_ was chosen for
  StrainingSpeed speed_;
  bool straining_ = false;  ///< a strained stage is loading; stays true if it stopped or diverged
  double dt_ = 0;
  std::int64_t since_inspection_ = 0;
  std::int64_t interval_ = 1;  ///< steps between inspections now
  bool begun_ = false;
  bool first_interval_ = false;  ///< up to the first inspection after forces were first evaluated
  Follow follow_;
  std::function<absl::Status(Assembly&)> intervention_;
  std::array<double, 3> stage_length_ = {0, 0, 0};  ///< of the cell when the stage began [m]
  std::string moment_text_;  ///< where moments shorten the step much: Assembly::MomentStepText()
  std::string reason_;
};

}  // namespace calib::dem
