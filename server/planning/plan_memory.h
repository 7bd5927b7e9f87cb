#pragma once
// What a plan need not work out again from the store because the plan before it has.

#include <memory>
#include <optional>

#include "server/planning/history.h"

namespace calib::planning {

/// Of a method, which says what.
struct PlannerMemory {
  PlannerMemory() = default;
  PlannerMemory(const PlannerMemory&) = delete;
  PlannerMemory& operator=(const PlannerMemory&) = delete;
  virtual ~PlannerMemory() = default;
};

/// Nothing that the store does not give again bit for bit. Empty after a start. One plan at a time.
struct PlanMemory {
  /// As read last, all of it ended; where batches stay as they are (Method::keeps_batches).
  std::optional<History> history;
  std::unique_ptr<PlannerMemory> of_method;

  /// A method's own, made when it is first asked for.
  template <typename Own>
  Own& Of() {
    if (of_method == nullptr) of_method = std::make_unique<Own>();
    return static_cast<Own&>(*of_method);  // a campaign keeps its method
  }
};

}  // namespace calib::planning
