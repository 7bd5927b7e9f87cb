#pragma once
// Grains under gravity in real time: no stages, no servo, time passes.

#include <array>
#include <cstdint>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "dem/dynamics/assembly.h"
#include "dem/dynamics/quasi_static.h"

namespace calib::dem {

struct FlowOptions {
  double damping = 0;      ///< local damping while flowing, 0 .. 1 [-]
  double drag = 0;         ///< global viscous damping [1/s] >= 0
  double drop_height = 0;  ///< largest height that a grain may fall in this test [m] > 0
  Vec3 low{}, high{};      ///< grains that leave this box have escaped [m]
  double still = 1e-2;     ///< at rest: rms speed of grains over sqrt(g d) [-]
};

/// A grain that fell below the drain.
struct Drained {
  double time = 0;  ///< [s]
  double mass = 0;  ///< [kg]
  double y = 0;     ///< where it went through [m]
};

/// Drives an assembly through time. Looks at the stop token every step.
class Flow {
 public:
  /// The step is this share of sqrt(m/K), K of two of the smallest grains that meet at the speed of
  /// the largest fall, unloading included: about ten steps in the shortest collision.
  static constexpr double kSafety = 0.3;

  Flow(Assembly& assembly, const FlowOptions& options, std::stop_token stop);

  /// Lets a duration pass, to the end of the step that reaches it.
  StageEnd Advance(double duration);

  /// Until the grains are at rest, or the longest time has passed, which is no failure. Rest is
  /// looked for every sqrt(d/g) and found when seen three times in a row. With this local damping.
  StageEnd Settle(double longest, double damping);

  /// Called between motion and forces with the time and the step that is likely to follow: sets
  /// velocities of walls, lets grains join.
  void SetBeforeStep(std::function<void(double time, double dt)> before) {
    before_ = std::move(before);
  }

  /// Grains whose centre falls below this are taken out and recorded [m].
  void SetDrain(double z) { drain_ = z; }
  [[nodiscard]] const std::vector<Drained>& drained() const { return drained_; }

  /// Everything that determines what follows, as bytes. Hooks, options and the model are the
  /// caller's to make again.
  [[nodiscard]] std::string Checkpoint() const;

  /// Goes back to a checkpoint of a flow of the same model: from there on the same bits follow, on
  /// any number of threads. Errors: INVALID_ARGUMENT saying why the bytes are none, of another
  /// engine or of another model; the flow is then unchanged.
  absl::Status Restore(const std::string& bytes);

  [[nodiscard]] double time() const { return time_; }
  [[nodiscard]] double time_step() const { return dt_; }
  [[nodiscard]] const std::string& reason() const { return reason_; }
  [[nodiscard]] Assembly& assembly() { return *assembly_; }
  [[nodiscard]] const Assembly& assembly() const { return *assembly_; }

  /// Mean square speed of the grains [m^2/s^2]; 0 without grains.
  [[nodiscard]] double MeanSquareSpeed() const;

 private:
  StageEnd Step(double damping);
  StageEnd Inspect();
  StageEnd Diverge(std::string reason);
  void TakeOut();

  Assembly* assembly_;
  FlowOptions options_;
  std::stop_token stop_;
  std::function<void(double, double)> before_;
  double drain_ = -1e300;
  std::vector<Drained> drained_;
  double time_ = 0;
  double largest_dt_ = 0;
  double dt_ = 0;
  std::int64_t since_inspection_ = 0;
  bool begun_ = false;
  std::string reason_;
};

}  // namespace calib::dem
