#pragma once
// What a plan need not work out again from the store because the plan before it has.

#include <cstddef>
#include <optional>

#include "inference/tmcmc/tmcmc.h"
#include "server/scheduler/history.h"

namespace calib::scheduler {

/// Of a campaign whose batches do not change once they have ended (tmcmc): nothing that the store
/// does not give again bit for bit. Empty after a start. One plan at a time.
struct PlanMemory {
  std::optional<History> history;               ///< as read last, all of it ended
  std::optional<inference::TmcmcState> chains;  ///< where the chains stand after `batches`
  std::size_t batches = 0;
};

}  // namespace calib::scheduler
