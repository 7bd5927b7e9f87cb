#pragma once
// Walks a test of grains under gravity: settings, pouring, reporting; the tests' own procedures are
// in the files NAME_run.cc.

#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "dem/dynamics/flow.h"
#include "dem/particles/loose_fill.h"
#include "dem/simulation/element_test_run.h"
#include "dem/simulation/scenario.h"

namespace calib::dem {

/// Precondition: ScenarioProblems(scenario) is empty and its test is poured. Errors: those of the
/// sink.
absl::StatusOr<Summary> RunGravityTest(const Scenario& scenario, const LoadStepSink& sink,
                                       std::stop_token stop);

/// What the procedure of a test has at hand.
class GravityRun {
 public:
  GravityRun(const Scenario& scenario, const LoadStepSink& sink, std::stop_token stop);

  [[nodiscard]] const std::vector<ControlPoint>& path() const { return scenario_.path; }
  [[nodiscard]] double Setting(const std::string& name) const;
  /// The setting, or `chosen` where it is 0.
  [[nodiscard]] double SettingOr(const std::string& name, double chosen) const;

  [[nodiscard]] const std::vector<double>& radii() const { return scenario_.packing.radius; }
  [[nodiscard]] double mean_diameter() const { return mean_diameter_; }
  [[nodiscard]] double largest_diameter() const { return largest_diameter_; }
  [[nodiscard]] double gravity() const { return Setting("gravity"); }
  [[nodiscard]] double density() const { return scenario_.model.density; }
  [[nodiscard]] std::uint64_t seed() const { return scenario_.seed; }
  /// sqrt(d/g), the time of a fall by half a mean diameter [s].
  [[nodiscard]] double fall_time() const;

  /// Grains between walls; surroundings get the test's gravity.
  [[nodiscard]] Assembly Make(const Packing& grains, Surroundings surroundings) const;

  /// drop_height and the box of the options are the procedure's; damping and drag the settings'.
  [[nodiscard]] Flow Drive(Assembly& assembly, FlowOptions options) const;

  /// Local damping while poured grains come to rest.
  static constexpr double kSettling = 0.3;

  /// Gives a state to the sink where the point wants one. kDiverged where a value is not finite or
  /// the sink fails.
  StageEnd Report(const ControlPoint& point, const std::vector<double>& values,
                  const Assembly& assembly);

  StageEnd Fail(std::string reason);

  /// Adds a flow's steps to the summary and keeps why it ended. `first`: the steps and updates that
  /// its assembly came with.
  struct Mark {
    std::int64_t steps = 0, updates = 0;
  };
  static Mark MarkOf(const Assembly& assembly) {
    return {assembly.steps(), assembly.contact_updates()};
  }
  StageEnd Close(StageEnd end, const Flow& flow, const Mark& first, const std::string& where);

  [[nodiscard]] absl::StatusOr<Summary> Finish(StageEnd end) const;

 private:
  const Scenario& scenario_;
  const LoadStepSink& sink_;
  std::stop_token stop_;
  const std::vector<std::string>& observables_;
  double mean_diameter_ = 0;
  double largest_diameter_ = 0;
  std::string reason_;
  absl::Status sink_status_;
  Summary summary_;
};

StageEnd RunAngleOfRepose(GravityRun& run);
StageEnd RunSiloDischarge(GravityRun& run);
StageEnd RunRotatingDrum(GravityRun& run);
StageEnd RunCalibrationDevice(GravityRun& run);
StageEnd RunTransferChute(GravityRun& run);
StageEnd RunShakenBox(GravityRun& run);

}  // namespace calib::dem
