// Batches of a design as they are stored.
#include "server/diagnosis/run_maker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "server/diagnosis/design_rows.h"
#include "tests/support/race_toy.h"

namespace calib::diagnosis {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class StoredDesign : public ::testing::Test {
 protected:
  RaceToy toy_{2, 5, 4};
  report::CampaignView view_ = toy_.Measured({}, 1);
  Race race_ = *RaceOf(view_, RaceToy::Without());
  DesignRows rows_{
      AxesOver(campaign::MarginalPriors(view_.campaign), Eigen::MatrixXd{{5e8, 0.3}, {1e9, 0.6}}),
      race_, Eigen::Vector2d(0.1, 0.2)};
  report::CampaignView design_ = [this] {
    report::CampaignView design = view_;
    design.campaign = CampaignOfDesign(view_.campaign, race_);
    // A file has them in another order.
    std::reverse(design.campaign.parameters.begin(), design.campaign.parameters.end());
    design.samples.clear();
    design.states.clear();
    return design;
  }();

  // states: of this sample of the base; -1: none.
  void Store(int iteration, int position, campaign::SamplePurpose stage, int stream, int states) {
    v1::Sample& sample = design_.samples.emplace_back();
    sample.set_index(iteration * campaign::kMostRowsOfBatch + position);
    sample.set_iteration(iteration);
    sample.set_purpose(campaign::ToString(stage));
    sample.set_status(states < 0 ? "diverged" : "finished");
    sample.set_stream(stream);
    if (states < 0) sample.set_reason("it flew away");
    for (std::size_t j = 0; j < design_.campaign.parameters.size(); ++j)
      sample.add_parameters(static_cast<double>(100 + j));
    for (const char* name : {"low", "high"}) {
      if (states >= 0) design_.states[{name, sample.index()}] = view_.states.at({name, states});
    }
  }
};

TEST_F(StoredDesign, HasItsBatchesInTheOrderInWhichTheyWereAskedFor) {
  Store(0, 0, campaign::SamplePurpose::kScout, 7, 2);
  Store(0, 1, campaign::SamplePurpose::kScout, 3, -1);
  Store(1, 0, campaign::SamplePurpose::kMain, 9, 1);
  const auto batches = EndedBatchesOf(design_, rows_.names());
  ASSERT_TRUE(batches.ok()) << batches.status();
  ASSERT_EQ(batches->size(), 2u);
  const EndedBatch& scout = (*batches)[0];
  EXPECT_EQ(scout.stage, campaign::SamplePurpose::kScout);
  ASSERT_EQ(scout.runs.size(), 2u);
  EXPECT_EQ(scout.runs[0].run.stream, 7);
  EXPECT_THAT(scout.runs[0].run.values, ElementsAre(106, 105, 104, 103, 102, 101, 100));
  ASSERT_TRUE(scout.runs[0].readings.has_value());
  EXPECT_NEAR((*scout.runs[0].readings)[0], view_.states.at({"low", 2}).states[0].values(0), 1e-6);
  EXPECT_FALSE(scout.runs[1].readings.has_value());
  EXPECT_EQ(scout.runs[1].reason, "it flew away");
  EXPECT_EQ((*batches)[1].stage, campaign::SamplePurpose::kMain);
}

TEST_F(StoredDesign, OpenRunsAndOtherParametersAreSaid) {
  Store(0, 0, campaign::SamplePurpose::kScout, 7, 2);
  design_.samples[0].set_status("running");
  EXPECT_THAT(EndedBatchesOf(design_, rows_.names()).status().message(), HasSubstr("is open"));
  std::vector<std::string> other = rows_.names();
  other.pop_back();
  const auto status = EndedBatchesOf(design_, other).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(status.message(), HasSubstr("was made for other parameters"));
}

}  // namespace
}  // namespace calib::diagnosis
