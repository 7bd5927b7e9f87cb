#include "server/ctl/diagnosis_support.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace calib::ctl {
namespace {

using ::testing::HasSubstr;

inference::FittedModel Known(int packings, int left_out) {
  inference::FittedModel model;
  model.packings = packings;
  for (int i = 0; i < left_out; ++i) model.without.emplace_back(1, 1);
  return model;
}

TEST(FewPackings, AreSaidWithWhatTheyCost) {
  EXPECT_EQ(FewPackings(Known(0, 0)), "") << "packings were not varied";
  EXPECT_THAT(FewPackings(Known(3, 0)),
              HasSubstr("with fewer than 4 nothing is called missing (`realizations: 8`"));
  EXPECT_THAT(FewPackings(Known(4, 4)),
              HasSubstr("known from 4 of them, so that a misfit must be"));
  EXPECT_THAT(FewPackings(Known(6, 0)), HasSubstr("different numbers of packings"));
  EXPECT_EQ(FewPackings(Known(8, 8)), "");
}

}  // namespace
}  // namespace calib::ctl
