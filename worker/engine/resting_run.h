#pragma once
// An attempt that goes on from where its run rests, and rests again at its rung or when it has to
// leave.

#include <chrono>
#include <optional>
#include <stop_token>
#include <string>

#include "calib/v1/worker.pb.h"
#include "dem/model/scenario.h"
#include "dem/model/state.h"
#include "worker/engine/checkpoints.h"
#include "worker/engine/specimens.h"

namespace calib::worker {

struct RestingRun {
  std::string run{};                ///< digest under which it is kept
  std::optional<int> rest_after{};  ///< load step; empty: it goes to its end
  std::stop_token leave{};          ///< the run ends here and goes on elsewhere
};

/// How much of a run is lost at most when its machine fails. chosen: a file now and then is no
/// load, and runs worth keeping take hours
constexpr std::chrono::minutes kBetweenCheckpoints{10};

/// Evaluate() (evaluate.h) from the checkpoint of this run, if there is one, until its rung: then
/// OUTCOME_RESTING. sink gets the states from the first one on again, none behind the rung. A
/// checkpoint is kept when the run rests, when it has to leave (OUTCOME_STOPPED) and every
/// kBetweenCheckpoints, and removed when it has ended; checkpoints may be nullptr: none are. steps
/// and contact_updates of all attempts of a run add up to those of an undisturbed one. The states
/// have the same bits with and without a checkpoint.
v1::Finished EvaluateToRung(const v1::AttemptSpec& spec, const RestingRun& resting,
                            const Checkpoints* checkpoints, Specimens& specimens,
                            const dem::StateSink& sink, std::stop_token stop);

}  // namespace calib::worker
