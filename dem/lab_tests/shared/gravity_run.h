#pragma once
// Walks a test of grains under gravity: settings, pouring, reporting; the tests' own procedures are
// in the files of lab_tests.

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

/// What the procedure of a test has at hand.
class GravityRun {
 public:
  explicit GravityRun(const TestRun& run);

  [[nodiscard]] const std::vector<ControlPoint>& path() const { return scenario_.path; }

  /// Calls `visit` for the points of the path in order, from where the run begins, until one does
  /// not end well. After each the run can go on from what `state` gives: members for Recall(),
  /// archived; empty where every point starts anew.
  StageEnd Walk(const std::function<StageEnd(const ControlPoint& point)>& visit,
                const std::function<std::string()>& state = {});

  /// The same for tests whose points all start from one filling: lets `assembly` come to rest for
  /// at most `longest` [s], or takes the filling from the checkpoint, then walks.
  StageEnd WalkFrom(Assembly& assembly, const FlowOptions& options, double longest,
                    const std::function<StageEnd(const ControlPoint& point)>& visit);

  /// Whether the run goes on from a checkpoint.
  [[nodiscard]] bool resumed() const { return record_.resumed(); }

  /// Takes members back from what Walk's `state` gave before the interruption.
  template <class... T>
  StageEnd RestoreState(T&... members) {
    LoadArchive archive(state_);
    archive(members...);
    return archive.complete() ? StageEnd::kDone : Abandon(DoesNotFit());
  }

  /// Ends the run with an error.
  StageEnd Abandon(absl::Status status);

  [[nodiscard]] double Setting(const std::string& name) const;
  /// The setting, or `chosen` where it is 0.
  [[nodiscard]] double SettingOr(const std::string& name, double chosen) const;

  /// The mesh that replaces a piece of the test's boundary, or nullptr.
  [[nodiscard]] const TriangleMesh* Mesh(const std::string& name) const;

  [[nodiscard]] const std::vector<double>& radii() const { return scenario_.packing.radius; }
  [[nodiscard]] double mean_diameter() const { return mean_diameter_; }
  [[nodiscard]] double largest_diameter() const { return largest_diameter_; }
  [[nodiscard]] double gravity() const { return Setting("gravity"); }
  [[nodiscard]] double density() const { return scenario_.model.density; }
  /// Length over width of the grains (nonspherical_shape); 1: spheres. What the test chooses of its
  /// device does not depend on it.
  [[nodiscard]] double aspect() const { return aspect_; }
  /// Of a grain whose radius is 1; of disks where the test's thickness makes them.
  [[nodiscard]] const ClumpTemplate& shape() const { return shape_; }
  /// Spheres that a grain is made of.
  [[nodiscard]] int spheres_per_grain() const { return static_cast<int>(shape_.spheres.size()); }
  /// Longest way through a grain [m].
  [[nodiscard]] double largest_length() const { return ReachOf(shape_) * largest_diameter_; }
  /// Volume of all grains [m^3].
  [[nodiscard]] double solid_volume() const;
  [[nodiscard]] std::uint64_t seed() const { return scenario_.seed; }
  /// sqrt(d/g), the time of a fall by half a mean diameter [s].
  [[nodiscard]] double fall_time() const;

  /// Material of a body of the test, "": the model's own.
  [[nodiscard]] std::string MaterialOf(const std::string& body) const;

  /// Draws the materials of grains where the scenario mixes some.
  void MixMaterials(Packing& grains) const;

  /// The grains in a region: LooseFill of spheres, RandomFill of others.
  [[nodiscard]] Packing Fill(const FillRegion& region, std::uint64_t seed) const;
  /// How many of the grains a filling has.
  [[nodiscard]] std::size_t CountOf(const Packing& filling) const {
    return filling.x.size() / static_cast<std::size_t>(spheres_per_grain());
  }

  /// Grains between walls; surroundings get the test's gravity and the walls' material. Grains
  /// without materials are mixed first.
  [[nodiscard]] Assembly MakeAssembly(const Packing& grains, Surroundings surroundings) const;

  /// drop_height and the box of the options are the procedure's; damping and drag the settings'.
  [[nodiscard]] Flow MakeFlow(Assembly& assembly, FlowOptions options) const;

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
  StageEnd AddToSummary(StageEnd end, const Flow& flow, const Mark& first,
                        const std::string& where);

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
  Summary summary_;    ///< what it counts so far
  std::string state_;  ///< of the procedure, at the interruption
};

/// The procedure of a test that pours its grains. Errors: those of the record, and INVALID_ARGUMENT
/// for a checkpoint that does not fit.
std::function<absl::StatusOr<Summary>(const TestRun&)> GravityProcedure(
    StageEnd (*walk)(GravityRun&));

}  // namespace calib::dem
