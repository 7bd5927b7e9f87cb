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

/// How a flow is driven.
struct FlowOptions {
  double damping = 0;      ///< local damping while flowing, 0 .. 1 [-]
  double drag = 0;         ///< global viscous damping [1/s] >= 0
  double drop_height = 0;  ///< largest height that a grain may fall in this test [m] > 0
  Vec3 low{}, high{};      ///< grains that leave this box have escaped [m]
  double still = 1e-2;     ///< grains are at rest below this rms speed over sqrt(g d) [-] > 0.
                           ///< Chosen: a fall by 5e-5 mean diameters gives it
};

/// A grain that fell below the drain (Flow::SetDrain) and was taken out.
struct Drained {
  double time = 0;  ///< [s]
  double mass = 0;  ///< [kg]
  double y = 0;     ///< coordinate at which it was taken out [m]
};

/// Drives an assembly, which has to outlive it, through time. Looks at the stop token every step.
/// Not thread-safe.
class Flow {
 public:
  /// The step over sqrt(m/K) [-], K the stiffness of two of the smallest grains that meet at the
  /// speed of the largest fall, unloading included. Chosen: about ten steps in the shortest
  /// collision (dem/DECISIONS.md, the step of a flow follows the fastest impact).
  static constexpr double kSafety = 0.3;

  /// The assembly's surroundings have gravity.
  Flow(Assembly& assembly, const FlowOptions& options, std::stop_token stop);

  /// Lets a duration [s] pass, to the end of the step that reaches it.
  StageEnd Advance(double duration);

  /// Lets time pass with this local damping [-], 0 .. 1, until the grains are at rest or the
  /// longest time [s] has passed, which is no failure. Rest is looked for every sqrt(d/g) and found
  /// when seen three times in a row.
  StageEnd Settle(double longest, double damping);

  /// Sets what is called between motion and forces of every step, with the time [s] and the step
  /// [s] that is likely to follow; it may set velocities of walls and let grains join.
  void SetBeforeStep(std::function<void(double time, double dt)> before) {
    before_ = std::move(before);
  }

  /// Takes out and records grains whose centre falls below z [m] from now on.
  void SetDrain(double z) { drain_ = z; }
  /// All grains taken out so far, in order of time.
  [[nodiscard]] const std::vector<Drained>& drained() const { return drained_; }

  /// Everything that determines what follows, as bytes. Hooks, options and the model are the
  /// caller's to make again.
  [[nodiscard]] std::string Checkpoint() const;

  /// Goes back to a checkpoint of a flow of the same model: from there on the same bits follow, on
  /// any number of threads. Errors: INVALID_ARGUMENT saying why the bytes are none, of another
  /// engine or of another model; the flow is then unchanged.
  absl::Status Restore(const std::string& bytes);

  /// Time that has passed [s].
  [[nodiscard]] double time() const { return time_; }
  /// The present time step [s].
  [[nodiscard]] double time_step() const { return dt_; }
  /// Why the last call returned kDiverged.
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
