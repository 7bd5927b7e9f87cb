#pragma once
// What the procedure of a test is given.

#include <stop_token>

#include "dem/lab_tests/shared/run_record.h"
#include "dem/model/lab_test.h"
#include "dem/model/model_entries.h"
#include "dem/model/scenario.h"

namespace calib::dem {

/// One run of one scenario; what it refers to outlives the procedure.
struct TestRun {
  const Scenario& scenario;     ///< ScenarioProblems() finds nothing wrong with it
  const ModelEntries& entries;  ///< EntriesOf(scenario.model)
  const TestInfo& test;         ///< the catalogue entry of scenario.test
  RunRecord& record;            ///< takes states and checkpoints
  std::stop_token stop;         ///< looked at every time step
};

}  // namespace calib::dem
