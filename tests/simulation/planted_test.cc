// With the copy of the scheduler that has faults planted.
#include <gtest/gtest.h>

#include "tests/simulation/faults.h"
#include "tests/simulation/simulation.h"

namespace calib::simulation {
namespace {

TEST(Planted, IsFoundByItsSeedAndNothingWithoutIt) {
  for (const Fault& fault : Faults()) {
    if (!fault.in_scheduler) continue;
    EXPECT_NE(Simulate({.seed = fault.seed, .fault = fault.name}).violation, "") << fault.name;
    EXPECT_EQ(Simulate({.seed = fault.seed}).violation, "") << fault.name;
  }
}

// Of every fault, from any seeds: deploy/nightly.
TEST(PlantedSlow, IsFoundWithinTwoHundredSeeds) {
  for (const Fault& fault : Faults()) {
    std::uint64_t seed = 1001;
    while (seed <= 1200 && Simulate({.seed = seed, .fault = fault.name}).violation.empty()) ++seed;
    EXPECT_LE(seed, 1200U) << fault.name;
  }
}

}  // namespace
}  // namespace calib::simulation
