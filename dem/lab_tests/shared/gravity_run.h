#pragma once
// Walks a test of grains under gravity: settings, pouring, reporting; the tests' own procedures are
// in the files of lab_tests.

#include <cmath>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "dem/dynamics/archive.h"
#include "dem/dynamics/flow.h"
#include "dem/lab_tests/shared/gravity_test.h"
#include "dem/lab_tests/shared/test_run.h"
#include "dem/model/test_entry.h"
#include "dem/particles/clump_template.h"
#include "dem/particles/loose_fill.h"

namespace calib::dem {

/// Shape of a poured grain whose radius is 1 and whose length over width is `aspect`; disks: a pair
/// of disks in place of two spheres.
ClumpTemplate GrainShape(double aspect, bool disks);

/// One run of a test under gravity: what its procedure asks of the scenario, and whom it reports
/// to. Not thread-safe.
class GravityRun {
 public:
  /// What `run` refers to has to outlive it.
  explicit GravityRun(const TestRun& run);

  /// The scenario's path.
  [[nodiscard]] const std::vector<ControlPoint>& path() const { return scenario_.path; }

  /// Calls `visit` for the points of the path in order, from where the run begins, until one does
  /// not end well. After each point a checkpoint is written from which the run can go on: it holds
  /// the bytes that `state` gives, an archive of the members that RestoreState() takes back. state
  /// is empty where every point starts anew.
  StageEnd Walk(const std::function<StageEnd(const ControlPoint& point)>& visit,
                const std::function<std::string()>& state = {});

  /// Walk() for tests whose points all start from one filling: lets `assembly` come to rest for
  /// at most `longest` [s], or takes the filling from the checkpoint, then walks.
  StageEnd WalkFrom(Assembly& assembly, const FlowOptions& options, double longest,
                    const std::function<StageEnd(const ControlPoint& point)>& visit);

  /// Whether the run goes on from a checkpoint.
  [[nodiscard]] bool resumed() const { return record_.resumed(); }

  /// Reads members from the bytes that Walk's `state` gave before the interruption. kDiverged, with
  /// an error for Finish(), where they do not fit.
  template <class... T>
  StageEnd RestoreState(T&... members) {
    LoadArchive archive(state_);
    archive(members...);
    return archive.complete() ? StageEnd::kDone : Abandon(DoesNotFit());
  }

  /// Lets Finish() return an error; returns kDiverged.
  StageEnd Abandon(absl::Status status);

  /// A setting of the test by name, or its default [the setting's SI unit]. Precondition: the test
  /// has it.
  [[nodiscard]] double Setting(const std::string& name) const;
  /// A setting of the test by name, or `chosen` where the setting is 0 [the setting's SI unit].
  [[nodiscard]] double SettingOr(const std::string& name, double chosen) const;

  /// The mesh that replaces a piece of the test's boundary, or nullptr.
  [[nodiscard]] const TriangleMesh* Mesh(const std::string& name) const;

  /// Radii of the grains to pour [m].
  [[nodiscard]] const std::vector<double>& radii() const { return scenario_.packing.radius; }
  /// Mean diameter of the grains [m].
  [[nodiscard]] double mean_diameter() const { return mean_diameter_; }
  /// Largest diameter of the grains [m].
  [[nodiscard]] double largest_diameter() const { return largest_diameter_; }
  /// Acceleration of free fall [m/s^2].
  [[nodiscard]] double gravity() const { return Setting("gravity"); }
  /// Density of the model's own material [kg/m^3].
  [[nodiscard]] double density() const { return scenario_.model.density; }
  /// Length over width of the grains [-]; 1: spheres. What the test chooses of its device does not
  /// depend on it.
  [[nodiscard]] double aspect() const { return aspect_; }
  /// Shape of a grain whose radius is 1; a pair of disks where the test's thickness makes disks.
  [[nodiscard]] const ClumpTemplate& shape() const { return shape_; }
  /// Number of spheres that a grain is made of.
  [[nodiscard]] int spheres_per_grain() const { return static_cast<int>(shape_.spheres.size()); }
  /// Longest way through a grain [m].
  [[nodiscard]] double largest_length() const { return ReachOf(shape_) * largest_diameter_; }
  /// Volume of all grains [m^3].
  [[nodiscard]] double solid_volume() const;
  /// Seed of the scenario.
  [[nodiscard]] std::uint64_t seed() const { return scenario_.seed; }
  /// sqrt(d/g), the time of a fall by half a mean diameter [s].
  [[nodiscard]] double fall_time() const;

  /// Name of the material of a body of the test (TestInfo::bodies); "": the model's own.
  [[nodiscard]] std::string MaterialOf(const std::string& body) const;

  /// Draws the materials of grains where the scenario mixes some.
  void MixMaterials(Packing& grains) const;

  /// The grains set into a region, by LooseFill() where they are spheres, by RandomFill() where
  /// not.
  [[nodiscard]] Packing Fill(const FillRegion& region, std::uint64_t seed) const;
  /// Number of grains that a filling has.
  [[nodiscard]] std::size_t CountOf(const Packing& filling) const {
    return filling.x.size() / static_cast<std::size_t>(spheres_per_grain());
  }

  /// An assembly of grains between walls; the surroundings get the test's gravity and the walls'
  /// material. Grains without materials get them by MixMaterials() first.
  [[nodiscard]] Assembly MakeAssembly(const Packing& grains, Surroundings surroundings) const;

  /// A flow of the assembly. The procedure gives drop_height and the box of the options; damping
  /// and drag are set here from the settings.
  [[nodiscard]] Flow MakeFlow(Assembly& assembly, FlowOptions options) const;

  /// Local damping while poured grains come to rest [-]. Chosen: stronger damping would let the
  /// last rearrangements creep.
  static constexpr double kSettling = 0.3;
  /// The longest time that poured grains get to come to rest, over sqrt(height / gravity) [-].
  /// Chosen: 28 free falls through the height.
  static constexpr double kLongestSettling = 40;
  /// That time, for grains that fill up to `height` [m] [s].
  [[nodiscard]] double LongestSettling(double height) const {
    return kLongestSettling * std::sqrt(height / gravity());
  }

  /// Gives a state to the sink where the point wants one. kDiverged where a value is not finite or
  /// the sink fails.
  StageEnd Report(const ControlPoint& point, const std::vector<double>& values,
                  const Assembly& assembly);

  /// Gives the reason for which the run has failed; returns kDiverged.
  StageEnd Fail(std::string reason);

  /// Numbers of steps and contact updates that an assembly has made.
  struct Mark {
    std::int64_t steps = 0, updates = 0;
  };
  static Mark MarkOf(const Assembly& assembly) {
    return {assembly.steps(), assembly.contact_updates()};
  }
  /// Adds to the summary what a flow has done since its assembly had made `first`, and, where `end`
  /// is kDiverged, why, after the words `where`. Returns `end`.
  StageEnd AddToSummary(StageEnd end, const Flow& flow, const Mark& first,
                        const std::string& where);

  /// The summary of a run that ended so, or the error that ended it.
  [[nodiscard]] absl::StatusOr<Summary> Finish(StageEnd end) const;

 private:
  [[nodiscard]] static absl::Status DoesNotFit();
  StageEnd WriteCheckpoint(std::size_t next, std::string state);

  const Scenario& scenario_;
  RunRecord& record_;
  std::stop_token stop_;
  const TestInfo& test_;
  const ModelEntries& entries_;
  double aspect_ = 1;
  ClumpTemplate shape_;
  double mean_diameter_ = 0;
  double largest_diameter_ = 0;
  std::string reason_;
  absl::Status status_;
  Summary summary_;    ///< steps and updates so far
  std::string state_;  ///< bytes for RestoreState(); empty: not resumed
};

/// The procedure of a test that pours its grains and is walked by `walk`. Errors: those of the
/// record, and INVALID_ARGUMENT for a checkpoint that does not fit.
std::function<absl::StatusOr<Summary>(const TestRun&)> GravityProcedure(
    StageEnd (*walk)(GravityRun&));

}  // namespace calib::dem
