#include "server/diagnosis/base_misfit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>

#include "server/diagnosis/base_region.h"
#include "tests/support/race_toy.h"

namespace calib::diagnosis {
namespace {

using ::testing::HasSubstr;

// What is known before a design of a measurement of the model itself. shift: of the prior, in
// lengths of its range, after the region was found.
absl::StatusOr<BaseMisfit> MisfitUnderPriorMovedBy(double shift) {
  const RaceToy toy(1, 5, 60);
  const report::CampaignView view = toy.Measured({.x = 0.4, .y = 0.6}, 1);
  BaseRuns base = *BaseRunsOf(view);
  BaseRegion region = *RegionOf(base, campaign::Priors(view.campaign));
  Race nobody;
  campaign::Campaign moved = view.campaign;
  for (campaign::CalibratedParameter& parameter : moved.parameters) {
    const double length = parameter.prior.max - parameter.prior.min;
    parameter.prior.min += shift * length;
    parameter.prior.max += shift * length;
    nobody.base.push_back(parameter.name);
  }
  const DesignRows rows(region.axes, std::move(nobody), Eigen::VectorXd(0));
  return MisfitOfBase({.base = std::move(base),
                       .region = std::move(region),
                       .prior = campaign::Priors(moved),
                       .seed = 5},
                      rows, {});
}

TEST(BaseMisfit, AModelThatIsRightIsMissedByItsErrors) {
  const auto misfit = MisfitUnderPriorMovedBy(0);
  ASSERT_TRUE(misfit.ok()) << misfit.status();
  EXPECT_GT(misfit->chance, 0.01);
  EXPECT_GT(misfit->degrees, 2);
}

// Such a model is not adequate in silence.
TEST(BaseMisfit, AModelWithoutAPosteriorIsNotJudged) {
  const auto misfit = MisfitUnderPriorMovedBy(2);
  ASSERT_FALSE(misfit.ok());
  EXPECT_EQ(misfit.status().code(), absl::StatusCode::kFailedPrecondition) << misfit.status();
  EXPECT_THAT(std::string(misfit.status().message()), HasSubstr("no point of the model"));
}

}  // namespace
}  // namespace calib::diagnosis
