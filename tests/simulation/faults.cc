#include "tests/simulation/faults.h"

namespace calib::simulation {

const std::vector<Fault>& Faults() {
  static const std::vector<Fault> all = {
      {.name = "early_acknowledgement", .seed = 1},
      {.name = "reordered_writes", .seed = 25},
      {.name = "no_sync", .seed = 1},
      {.name = "stale_states", .in_scheduler = true, .seed = 9},
      {.name = "counted_twice", .in_scheduler = true, .seed = 2},
      {.name = "end_without_states", .in_scheduler = true, .seed = 7},
      {.name = "no_give_back", .in_scheduler = true, .seed = 3},
      {.name = "two_leases", .in_scheduler = true, .seed = 1},
      {.name = "refusal_unsent", .in_scheduler = true, .seed = 1},
      {.name = "batch_by_arrival", .in_scheduler = true, .seed = 1},
      {.name = "iteration_lost", .in_scheduler = true, .seed = 2},
      {.name = "one_renewed", .in_scheduler = true, .seed = 58},
      {.name = "never_expires", .in_scheduler = true, .seed = 12},
      {.name = "drained_leased", .in_scheduler = true, .seed = 9},
  };
  return all;
}

}  // namespace calib::simulation
