// What is said of a campaign before any run is asked for.
#include "server/diagnosis/diagnosis_support.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/race_toy.h"

namespace calib::diagnosis {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(FewPackings, AreSaidWithWhatTheyCost) {
  EXPECT_EQ(FewPackings(0, 1), "") << "packings were not varied";
  EXPECT_EQ(FewPackings(1, 1), "");
  EXPECT_THAT(FewPackings(3, 3), HasSubstr("known from 3 of them, which is next to nothing"));
  EXPECT_THAT(FewPackings(15, 15), HasSubstr("`realizations: 16` or more lets smaller"));
  EXPECT_EQ(FewPackings(16, 16), "");
}

// Experiments of 4 and 6 packings have 2 groups that share none, however many runs there are.
TEST(FewPackings, ThatCannotBeToldApartAreSaidFirst) {
  EXPECT_THAT(FewPackings(6, 2), HasSubstr("together 2 can be told apart"));
  EXPECT_THAT(FewPackings(24, 3), HasSubstr("every experiment the same `realizations`, 16"));
  EXPECT_EQ(FewPackings(24, 4), "");
}

TEST(DiagnosisSupport, FewReadingsAndOnePackingAreDoubted) {
  campaign::Campaign campaign = RaceToy(1, 1, 1).Measured({}, 1).campaign;
  EXPECT_FALSE(HasFewReadings(campaign));
  EXPECT_THAT(DoubtsOf(campaign), IsEmpty());
  for (campaign::Experiment& e : campaign.experiments) {
    e.specimens.resize(1);
    for (campaign::MeasuredObservable& own : e.observables) {
      own.values.resize(3);  // two tests, two observables: 12 readings, and 15 are asked for
      own.sd.resize(3);
    }
    e.control.resize(3);
    e.path.resize(3);
    e.segment.resize(3);
  }
  EXPECT_TRUE(HasFewReadings(campaign));
  const std::vector<std::string> doubts = DoubtsOf(campaign);
  ASSERT_EQ(doubts.size(), 2U);
  EXPECT_THAT(doubts[0], HasSubstr("Only 12 readings are fitted with 2 parameters"));
  EXPECT_THAT(doubts[1], HasSubstr("run on one packing"));
}

TEST(DiagnosisSupport, OnlyEffectsThatThereAreCanBeLeftOut) {
  const campaign::Campaign campaign = RaceToy(1, 1, 1).Measured({}, 1).campaign;
  EXPECT_TRUE(CheckLeftOut({"e0", "rolling_resistance"}, campaign).ok());
  const absl::Status unknown = CheckLeftOut({"e0", "e1"}, campaign);
  EXPECT_EQ(unknown.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(unknown.message(), HasSubstr("there is no effect e1 to leave out"));
}

}  // namespace
}  // namespace calib::diagnosis
