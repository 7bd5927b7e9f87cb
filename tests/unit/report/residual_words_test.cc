#include "server/report/views/residual_words.h"

#include <gmock/gmock.h>

namespace calib::report {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<std::string> Said(double amplitude) {
  Comparison comparison;
  comparison.by_segment.push_back(
      {.experiment = "tx",
       .observable = "q_over_p",
       .segment = "unload_1",
       .from = 0.02,
       .to = 0.01,
       .bias = 0.2,
       .z = 8.0,
       .readings = 5,
       .rms_error = 6,
       .chi2_share = 0.5,
       .pattern = {.shape = ResidualShape::kAmplitude, .size = amplitude}});
  return WhereItFails(comparison);
}

TEST(ResidualWords, AFactorIsNeverNegative) {
  EXPECT_THAT(Said(0.5), ElementsAre(HasSubstr("too large by the factor 1.5 throughout")));
  EXPECT_THAT(Said(-0.4), ElementsAre(HasSubstr("too small by the factor 0.6 throughout")));
  EXPECT_THAT(Said(-1.42), ElementsAre(HasSubstr("goes the other way than the measurement")));
}

}  // namespace
}  // namespace calib::report
