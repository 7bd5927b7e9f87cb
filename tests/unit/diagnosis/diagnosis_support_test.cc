#include "server/diagnosis/diagnosis_support.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace calib::diagnosis {
namespace {

using ::testing::HasSubstr;

inference::FittedModel LeftOut(int packings) {
  inference::FittedModel model;
  for (int i = 0; i < packings; ++i) model.without.emplace_back(1, 1);
  return model;
}

TEST(FewPackings, AreSaidWithWhatTheyCost) {
  EXPECT_EQ(FewPackings(LeftOut(0), 0), "") << "packings were not varied";
  EXPECT_THAT(FewPackings(LeftOut(0), 3),
              HasSubstr("with fewer than 4 nothing is called missing (`realizations: 16`"));
  EXPECT_THAT(FewPackings(LeftOut(4), 4),
              HasSubstr("known from 4 of them, so that a misfit must be large"));
  EXPECT_THAT(FewPackings(LeftOut(0), 6), HasSubstr("fewer than 4 can be told apart"));
  EXPECT_THAT(FewPackings(LeftOut(8), 8), HasSubstr("`realizations: 16` or more"));
  EXPECT_EQ(FewPackings(LeftOut(15), 16), "") << "one has no run near the best point";
}

}  // namespace
}  // namespace calib::diagnosis
