#include "server/diagnosis/plan_words.h"

#include <gtest/gtest.h>

namespace calib::diagnosis {
namespace {

TEST(PlanWords, SayWhatIsSetAndHowTheControlGoes) {
  const PlannedExperiment unloaded{.test = "triaxial_drained",
                                   .settings = {{"confining_pressure", 8e5}},
                                   .unloading_at = 0.05,
                                   .control = "axial_strain",
                                   .path = {0.025, 0.05, 0.025, 0.05, 0.1}};
  EXPECT_EQ(InWords(unloaded),
            "triaxial_drained, confining pressure 800 kPa, one unloading and reloading at 5 %");
  EXPECT_EQ(WayInWords(unloaded), "axial strain to 5 %, back to 2.5 %, then to 10 %");
  const PlannedExperiment monotonic{
      .test = "triaxial_drained", .settings = {}, .control = "axial_strain", .path = {0.05, 0.1}};
  EXPECT_EQ(WayInWords(monotonic), "axial strain to 10 %");
}

TEST(PlanWords, ValuesThatAreRunsOfTheirOwnAreCounted) {
  const PlannedExperiment collision{
      .test = "collision", .settings = {}, .control = "impact_angle", .path = {0.1, 0.2, 0.3}};
  EXPECT_EQ(WayInWords(collision), "impact angle at 3 values from 5.73 deg to 17.2 deg");
}

}  // namespace
}  // namespace calib::diagnosis
