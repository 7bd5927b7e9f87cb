#include <gmock/gmock.h>

#include "server/ctl/diagnosis.h"

namespace calib::ctl {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(DiagnosisText, AGroupComesWithTheAnglesBetweenItsEffects) {
  ctl::Diagnosis diagnosis;
  diagnosis.verdict = "ambiguous";
  diagnosis.candidates = {{.effect = "rolling_resistance",
                           .confusable_with = {"twisting_resistance"},
                           .angles = {{"twisting_resistance", 7}, {"adhesion_dmt", 61}}},
                          {.effect = "twisting_resistance",
                           .angles = {{"rolling_resistance", 7}, {"adhesion_dmt", 63}}},
                          {.effect = "adhesion_dmt", .angles = {{"rolling_resistance", 61}}}};
  const std::string text = DiagnosisText(diagnosis);
  EXPECT_THAT(text, HasSubstr("rolling_resistance and twisting_resistance 7°"));
  EXPECT_THAT(text, Not(HasSubstr("61")));
}

}  // namespace
}  // namespace calib::ctl
