#pragma once
// Walks an element test: consolidation, then the control path, reporting each load step.

#include "absl/status/statusor.h"
#include "dem/lab_tests/shared/element_test.h"
#include "dem/lab_tests/shared/test_run.h"

namespace calib::dem {

/// Runs an element test to its end. plan: goals of the cell for each value of the control. Errors:
/// those of Simulate(), and those of the record.
absl::StatusOr<Summary> RunElementTest(const TestRun& run, PlanElementTest plan);

}  // namespace calib::dem
