#pragma once
// A lab test as the engine runs it: its catalogue entry, what it alone refuses, its procedure.

#include <algorithm>
#include <functional>
#include <numeric>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "dem/model/lab_test.h"
#include "dem/model/scenario.h"
#include "dem/model/state.h"

namespace calib::dem {

struct TestRun;  // lab_tests/shared/test_run.h

/// Sizes of grains, wherever they lie.
struct GrainSizes {
  std::vector<double> radii{};  ///< of spheres of their volume [m], at least one
  double thickness = 1;         ///< of a grain over the diameter of that sphere [-]; 1: spheres

  [[nodiscard]] double mean_diameter() const {  // [m]
    return 2 * std::accumulate(radii.begin(), radii.end(), 0.0) / static_cast<double>(radii.size());
  }
  [[nodiscard]] double smallest_diameter() const {  // [m]
    return 2 * *std::min_element(radii.begin(), radii.end());
  }
  [[nodiscard]] double largest_diameter() const {  // [m]
    return 2 * *std::max_element(radii.begin(), radii.end());
  }
};

/// What such sizes make of a scenario.
struct GrainRemarks {
  std::vector<std::string> refused{};  ///< why every run fails or shows nothing, a sentence each
  std::string few{};  ///< why so few grains mislead, the end of a sentence; empty: they are enough
};

/// A lab test as the registry holds it: catalogue entry, procedure, checks.
struct TestEntry {
  TestInfo info;
  int place = 1000;  ///< tests are listed in this order, then by name
  /// Runs the scenario of the run and reports its load steps. Errors: those of Simulate().
  /// Precondition: ScenarioProblems() finds nothing.
  std::function<absl::StatusOr<Summary>(const TestRun& run)> procedure;
  /// What is wrong with a scenario of this test beyond ranges of settings and control, a sentence
  /// each; null: nothing can be.
  std::vector<std::string> (*problems)(const Scenario& scenario) = nullptr;
  /// What grains of these sizes make of a scenario of this test; null: nothing.
  GrainRemarks (*grain_remarks)(const Scenario& scenario, const GrainSizes& grains) = nullptr;
};

}  // namespace calib::dem
