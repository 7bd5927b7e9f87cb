#pragma once
// One model evaluation: everything that determines its result, and what comes out. SI units,
// compression positive.

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "dem/formula/user_effect.h"
#include "dem/geometry/triangle_mesh.h"
#include "dem/particles/packing.h"

namespace calib::dem {

/// Contact law, effects and their parameters by dotted name ("young_modulus",
/// "rolling_resistance.stiffness").
struct Model {
  std::string contact;                       ///< a name of Contacts()
  std::vector<std::string> effects;          ///< names of Effects() or of user_effects
  double density = 2650;                     ///< of the grains [kg/m^3] > 0
  std::map<std::string, double> parameters;  ///< every parameter without a default must be present
  std::vector<UserEffect> user_effects{};    ///< declared; those that `effects` names act
  std::vector<std::string> materials{};      ///< besides the model's own, which is called `grains`;
                                             ///< their values are parameters (contact/materials.h)
};

/// Who is not of the model's own material. Grains of a packing may say so themselves.
struct MaterialUse {
  std::map<std::string, std::string> bodies{};  ///< by name: `walls` of tests under gravity (all of
                                                ///< them), `intruder` of shaken_box, `partner` of
                                                ///< collision, its wall included
  std::map<std::string, double> grains{};       ///< share of the number of grains, (0, 1] in all
  std::uint64_t seed = 0;                       ///< of the draw of `grains`, that of the specimen
};

/// Friction during consolidation, restored before loading. At most one is set; none: the model's
/// own friction.
struct Consolidation {
  std::optional<double> friction_coefficient;
  std::optional<double> porosity;  ///< friction is lowered until it holds
};

/// Principal stresses that replace the isotropic start [Pa].
struct InitialStress {
  double axial = 0;
  double lateral = 0;
};

/// How a quasi-static path is walked. Unset fields are chosen by the engine from the model (and
/// said in the Summary): DEM curves depend on staging by percents at low pressure, so comparisons
/// with another code fix all of them.
struct Staging {
  std::optional<double> rate;  ///< axial strain rate while straining [1/s] > 0
  std::optional<double> step;  ///< largest axial strain between two settlings [-] > 0
  std::optional<double>
      damping_loading;  ///< local (Cundall) damping while straining [-], default 0.2
  std::optional<double> damping_settling;  ///< while settling [-], default 0.9
  std::optional<double>
      unbalanced;         ///< mean unbalanced force / mean contact force that ends a settling [-]
  bool adaptive = false;  ///< fewer steps to the same curve: strains up to eight times as fast as
                          ///< `rate` where forces stay balanced, and settles at readings only, with
                          ///< less damping, unless step and damping_settling say otherwise
};

/// One point of the control path. Points are visited in order; the control may go down again.
struct ControlPoint {
  double target =
      0;  ///< of the test's control (TestInfo::control): logarithmic axial strain from the end of
          ///< consolidation, compression positive [-], or mean stress [Pa] (isotropic)
  int load_step = -1;  ///< index of the state reported here; -1: a turning point without a reading
};

struct Scenario {
  Model model;
  std::string test;  ///< a name of Tests()
  std::map<std::string, double>
      settings;  ///< the test's settings by name, e.g. confining_pressure [Pa]
  Packing packing;
  std::map<std::string, TriangleMesh> meshes = {};  ///< by name of TestInfo::meshes, with the
                                                    ///< origin and axes that stand there [m]
  MaterialUse materials{};
  Consolidation consolidation;
  std::optional<InitialStress> initial_stress;
  std::optional<double> loading_rate;  ///< [1/s]: real-rate loading instead of staged quasi-static
  Staging staging;
  std::vector<ControlPoint> path;
  int threads = 1;
  std::uint64_t seed = 0;  ///< for effects that draw random numbers
};

/// Staging with every field set: the scenario's, or the engine's choice for a packing of this mean
/// diameter [m] > 0. Precondition: the test is one in the periodic cell, with a confining_pressure.
Staging ResolveStaging(const Scenario& scenario, double mean_diameter);

/// Observables at one load step, in the order of the test's TestInfo::observables; all finite.
struct State {
  int load_step = 0;
  std::vector<double> values;
};

enum class Outcome {
  kCompleted,  ///< every point of the path was reached
  kStopped,    ///< the stop token was set
  kDiverged,   ///< NaN, lost grains, or a stage that never settled; Summary::reason says which,
               ///< where and when
};

struct Summary {
  Outcome outcome = Outcome::kCompleted;
  std::string reason;                ///< empty when completed
  std::int64_t steps = 0;            ///< time steps made
  std::int64_t contact_updates = 0;  ///< sum over steps of active contacts
  double time_step = 0;              ///< last time step [s]
  Staging staging;                   ///< as used, every field set
};

using StateSink = std::function<void(const State&)>;

/// Everything wrong with a scenario that can be known without running it, one sentence each; empty:
/// runnable.
std::vector<std::string> ScenarioProblems(const Scenario& scenario);

/// Bytes from which a run goes on, after a point of its path; they replace those of before. An
/// error ends the run with that error.
using CheckpointSink = std::function<absl::Status(const std::string& checkpoint)>;

/// How a run is recorded; nothing here changes its states.
struct Recording {
  std::string vtk_directory{};  ///< for a series of grains, contacts and walls after each load step
                                ///< (simulation/vtk_series.h); empty: none. Not of `collision`.
  CheckpointSink checkpoint{};  ///< called after each point of the path, when its state has been
                                ///< given to the sink; empty: no checkpoints. `collision` has none.
  std::string resume_from{};    ///< a checkpoint of this scenario: its states are given to the sink
                                ///< again, and the run goes on from there; empty: from the start
};

/// Why a run of this scenario cannot go on from a checkpoint, in a sentence; empty: it can.
std::string CheckpointProblem(const Scenario& scenario, const std::string& checkpoint);

/// Runs the scenario, calling sink once per load step as soon as it is reached, from the calling
/// thread. The stop token is looked at every time step. A diverged run is a result (Outcome), not
/// an error. Errors: INVALID_ARGUMENT (joined ScenarioProblems, CheckpointProblem), OUT_OF_RANGE
/// (unreachable consolidation porosity), UNAVAILABLE naming a VTK file that cannot be written, and
/// those of the checkpoint sink. Same scenario, same bits, for any number of threads and however
/// often it was interrupted. Thread-safe (no shared state).
absl::StatusOr<Summary> Simulate(const Scenario& scenario, const StateSink& sink,
                                 std::stop_token stop, const Recording& recording = {});

}  // namespace calib::dem
