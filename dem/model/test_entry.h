#pragma once
// A lab test as the engine runs it: its catalogue entry, what it alone refuses, its procedure.

#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "dem/model/lab_test.h"
#include "dem/model/scenario.h"
#include "dem/model/state.h"

namespace calib::dem {

struct TestRun;  // lab_tests/shared/test_run.h

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
};

}  // namespace calib::dem
