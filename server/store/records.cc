#include "server/store/records.h"

#include <array>

#include "server/campaign/model/word_table.h"

namespace calib::store {
namespace {

using campaign::Word;

constexpr std::array kAttemptOutcomeWords = {
    Word{AttemptOutcome::kCompleted, "completed"},
    Word{AttemptOutcome::kResting, "resting"},
    Word{AttemptOutcome::kStoppedEarly, "stopped_early"},
    Word{AttemptOutcome::kStopped, "stopped"},
    Word{AttemptOutcome::kDiverged, "diverged"},
    Word{AttemptOutcome::kModelFailed, "model_failed"},
    Word{AttemptOutcome::kFailed, "failed"},
    Word{AttemptOutcome::kLost, "lost"},
    Word{AttemptOutcome::kCancelled, "cancelled"},
};

}  // namespace

const char* ToString(AttemptOutcome outcome) {
  return campaign::WordOf(kAttemptOutcomeWords, outcome);
}

}  // namespace calib::store
