#include "server/report/views/residual_words.h"

#include <gmock/gmock.h>

#include "server/report/views/residual_pattern.h"

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
  // The residual is size times the model: measurements of 1/2, 2, 1.25 and -1 times it.
  EXPECT_THAT(Said(0.5), ElementsAre(HasSubstr("too large by the factor 2 throughout")));
  EXPECT_THAT(Said(-1), ElementsAre(HasSubstr("too small by the factor 0.5 throughout")));
  EXPECT_THAT(Said(-0.25), ElementsAre(HasSubstr("too small by the factor 0.8 throughout")));
  EXPECT_THAT(Said(2), ElementsAre(HasSubstr("the other way")));
}

// Deviatoric stress [kPa] of a drained test of 64 grains, measured as a multiple of it.
TEST(ResidualWords, AMultipleOfTheModelIsNamedByItsFactor) {
  Eigen::VectorXd model(6);
  model << 0.004, 117.2045, 210.2715, 259.8875, 283.914, 302.227;
  const auto said = [&model](double measured) {
    ResidualCurve curve;
    curve.control = Eigen::VectorXd::LinSpaced(6, 0, 0.02);
    curve.model = model;
    curve.residual = (1 - measured) * model;
    curve.sd = Eigen::VectorXd::Constant(6, 2);
    curve.correlation = Eigen::VectorXd::Zero(6);
    const ResidualPattern pattern = PatternOf(curve);
    EXPECT_EQ(pattern.shape, ResidualShape::kAmplitude) << measured;
    return Said(pattern.size);
  };
  EXPECT_THAT(said(2), ElementsAre(HasSubstr("too small by the factor 0.5 throughout")));
  EXPECT_THAT(said(0.5), ElementsAre(HasSubstr("too large by the factor 2 throughout")));
  EXPECT_THAT(said(1.25), ElementsAre(HasSubstr("too small by the factor 0.8 throughout")));
  EXPECT_THAT(said(-1), ElementsAre(HasSubstr("goes the other way than the measurement")));
}

}  // namespace
}  // namespace calib::report
