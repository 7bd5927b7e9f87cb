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

/// Goal of one axis of the cell: a cell length to reach exactly, or a stress to hold.
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
  std::int64_t max_settling_steps =
      200'000;  ///< time steps [-] > 0: a settling that takes longer has diverged
  std::int64_t max_loading_steps =
      20'000'000;  ///< time steps [-] > 0: a loading that takes longer has diverged
};

/// How far a followed target (Follow) is from its end.
struct FollowGap {
  double tolerances = 0;  ///< error in tolerances [-] >= 0; settled when at most one
  double strain = 0;      ///< strain still to go [-] >= 0
};
/// Lets a target follow the specimen, called before every step: `target` is what was asked for and
/// becomes what to do now, given the affine stiffness of each axis [Pa]; returns how far the stage
/// is from its end.
using Follow = std::function<FollowGap(const std::array<double, 3>& modulus, CellTarget& target)>;

/// How a stage of a run ended: its goal was reached, the stop token was set, or it failed.
enum class StageEnd { kDone, kStopped, kDiverged };

/// The rate of strained stages over StageOptions::rate, chosen at every inspection while straining
/// so that the unbalanced force stays near kTarget times the one that ends a settling:
///   f <- min(kFastest, max(1, f (kTarget unbalanced / U)^kGain))
/// Elastic stages, which leave little unbalanced, go at several times the rate; where grains
/// rearrange it is the rate asked for. Stages that hold stresses on all axes keep the rate. Not
/// thread-safe.
class StrainingSpeed {
 public:
  /// Chooses the factor anew. unbalanced: mean unbalanced over mean contact force, U [-] >= 0;
  /// settled: StageOptions::unbalanced.
  void Adapt(double unbalanced, double settled);
  /// The present rate over StageOptions::rate [-], 1 .. kFastest.
  [[nodiscard]] double factor() const { return factor_; }

  /// For archives: all state.
  template <class Archive>
  void Visit(Archive& archive) {
    archive(factor_);
  }

  /// Largest factor() [-]. Chosen; what it does to curves and steps is measured in
  /// dem/VERIFICATION.md, adaptive staging.
  static constexpr double kFastest = 8;

 private:
  /// Unbalanced force that is aimed at, over the one that ends a settling [-]. Chosen.
  static constexpr double kTarget = 2;
  /// Exponent of the correction [-]. Chosen.
  static constexpr double kGain = 0.25;
  double factor_ = 1;
};

/// Drives an assembly, which has to outlive it. Between calls its forces are those of its present
/// configuration. Looks at the stop token every step. Not thread-safe.
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

  /// Lets every target from now on follow the specimen; empty: targets are taken as they are given.
  void SetFollow(Follow follow) { follow_ = std::move(follow); }

  /// Sets what is called at every inspection (20 steps); it may change grains, as crushing does. An
  /// error ends the stage, with its message as the reason.
  void SetIntervention(std::function<absl::Status(Assembly&)> intervention) {
    intervention_ = std::move(intervention);
  }

  /// Lets stiffness be looked at anew before the next step. To be called when what contacts do has
  /// been changed from outside, as when dashpots begin to act.
  void InspectBeforeNextStep();

  [[nodiscard]] StageOptions& options() { return options_; }
  [[nodiscard]] Assembly& assembly() { return *assembly_; }
  /// The present time step [s].
  [[nodiscard]] double time_step() const { return dt_; }

  /// For archives: all state but options, Follow and intervention, which the caller sets again.
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
  std::array<double, 3> elastic_modulus_ = {0, 0, 0};  ///< by the last inspection [Pa]
  std::array<double, 3> viscosity_ = {0, 0, 0};        ///< by the last inspection [Pa s]
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
