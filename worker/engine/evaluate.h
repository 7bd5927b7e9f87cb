#pragma once
// One attempt from spec to end, on the calling thread.

#include <stop_token>

#include "absl/status/statusor.h"
#include "calib/v1/worker.pb.h"
#include "dem/model/scenario.h"
#include "dem/model/state.h"
#include "dem/simulate/simulate.h"
#include "worker/engine/specimens.h"

namespace calib::worker {

/// Runs a spec; sink gets every state as soon as it is reached. Never fails: what went wrong is the
/// outcome with its reason. OUTCOME_DIVERGED: the model cannot do it, or there is no such specimen;
/// OUTCOME_FAILED: neither is to blame. attempt and core_seconds are left to the caller.
v1::Finished Evaluate(const v1::AttemptSpec& spec, Specimens& specimens, const dem::StateSink& sink,
                      std::stop_token stop, const dem::Recording& recording = {});

}  // namespace calib::worker
