#pragma once
// Walks an element test: consolidation, then the control path, reporting each load step.

#include "absl/status/statusor.h"
#include "dem/lab_tests/shared/element_test.h"
#include "dem/lab_tests/shared/test_run.h"

namespace calib::dem {

/// plan: the test's goals of the cell. Errors as Simulate(), and those of the record.
absl::StatusOr<Summary> RunElementTest(const TestRun& run, PlanElementTest plan);

}  // namespace calib::dem
