#include "server/ctl/extension.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace calib::ctl {
namespace {

using ::testing::HasSubstr;

TEST(Extension, SaysWhatIsPossibleWithRunsThatWereMadeElsewhere) {
  campaign::Campaign campaign;
  campaign.model.contact = "linear";
  EXPECT_EQ(WhyNotJoin(campaign, "rolling_resistance"), "");
  campaign.precomputed = campaign::Precomputed{};
  const std::string why = WhyNotJoin(campaign, "rolling_resistance");
  EXPECT_THAT(why, HasSubstr("made elsewhere cannot be joined by rolling_resistance"));
  EXPECT_THAT(why, HasSubstr("calibctl diagnose"));
  EXPECT_THAT(WhyNotJoin(campaign, "magic"), HasSubstr("there is no effect magic"));
}

}  // namespace
}  // namespace calib::ctl
