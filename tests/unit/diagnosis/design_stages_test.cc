// Which batch comes next, and what may not follow what.
#include "server/diagnosis/design_stages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/design_caps.h"
#include "tests/support/race_toy.h"

namespace calib::diagnosis {
namespace {

using campaign::SamplePurpose;
using ::testing::HasSubstr;

class DesignStages : public ::testing::Test {
 protected:
  RaceToy toy_{3, 5, 30};
  DesignChain chain_ = *DesignChain::Create(toy_.Measured({.effect = 0, .units = 2}, 1),
                                            {.without = RaceToy::Without()});
  RunBatch NextBatch(DesignChain& chain) {
    const auto next = chain.Next();
    EXPECT_TRUE(next.ok()) << next.status();
    return next.ok() && std::holds_alternative<RunBatch>(*next) ? std::get<RunBatch>(*next)
                                                                : RunBatch();
  }
  EndedBatch Made(const RunBatch& batch) const {
    EndedBatch ended{.stage = batch.stage};
    for (const campaign::RunOf& run : batch.rows)
      ended.runs.push_back(toy_.Made(run, chain_.names()));
    return ended;
  }
};

TEST_F(DesignStages, AScoutHasEveryEffectTwiceAndTheNumericsOnce) {
  const RunBatch scout = NextBatch(chain_);
  EXPECT_EQ(scout.number, 0);
  EXPECT_EQ(scout.stage, SamplePurpose::kScout);
  ASSERT_EQ(scout.rows.size(), 9u);
  for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(scout.rows[i].stream, 30 + static_cast<int>(i));
  // The third has both signs.
  EXPECT_GT(scout.rows[2].values[4], 0);
  EXPECT_LT(scout.rows[5].values[4], 0);
  EXPECT_EQ(scout.rows[2].values[2], 0);
  for (std::size_t i = 6; i < 9; ++i) EXPECT_LT(scout.rows[i].stream, 30) << "beside a base run";
}

TEST_F(DesignStages, WhereRunsEndEarlyAWeakerScoutFollows) {
  EndedBatch ended = Made(NextBatch(chain_));
  const double tried = ended.runs[1].run.values[3];
  ended.runs[1].readings.reset();
  ASSERT_TRUE(chain_.Add(ended).ok());
  const RunBatch again = NextBatch(chain_);
  EXPECT_EQ(again.stage, SamplePurpose::kScout);
  ASSERT_EQ(again.rows.size(), 2u);
  EXPECT_NEAR(again.rows[0].values[3], kDesignCaps.weaker * tried, 1e-12);
  EXPECT_EQ(again.rows[0].stream, 39);
  // Once: who cannot run is left out.
  EndedBatch failed = Made(again);
  for (EndedRun& run : failed.runs) run.readings.reset();
  ASSERT_TRUE(chain_.Add(failed).ok());
  const RunBatch main = NextBatch(chain_);
  EXPECT_EQ(main.stage, SamplePurpose::kMain);
  EXPECT_EQ(main.rows.size(), 24u);
  for (const campaign::RunOf& run : main.rows) EXPECT_EQ(run.values[3], 0);
}

TEST_F(DesignStages, BatchesThatDoNotFollowAreRefused) {
  EXPECT_THAT(chain_.Add({.stage = SamplePurpose::kMain}).message(), HasSubstr("cannot follow"));
  EndedBatch scout = Made(NextBatch(chain_));
  EndedBatch broken = scout;
  broken.runs[0].run.values.pop_back();
  EXPECT_THAT(chain_.Add(broken).message(), HasSubstr("does not fit"));
  broken = scout;
  (*broken.runs[0].readings)[0] = std::nan("");
  EXPECT_THAT(chain_.Add(broken).message(), HasSubstr("does not fit"));
  ASSERT_TRUE(chain_.Add(scout).ok());
  EXPECT_FALSE(chain_.Add({.stage = SamplePurpose::kSequential}).ok());
  EXPECT_FALSE(chain_.Add({.stage = SamplePurpose::kVerification}).ok());
  ASSERT_TRUE(chain_.Add({.stage = SamplePurpose::kMain}).ok());
  EXPECT_FALSE(chain_.Add({.stage = SamplePurpose::kMain}).ok());
  EXPECT_FALSE(chain_.Add(scout).ok());
}

TEST_F(DesignStages, TooFewBaseRunsAreSaidWithTheNumberNeeded) {
  const auto chain =
      DesignChain::Create(RaceToy(3, 5, 20).Measured({}, 1), {.without = RaceToy::Without()});
  EXPECT_EQ(chain.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(chain.status().message(), HasSubstr("it takes 24 runs"));
}

TEST(DesignCaps, OfSeventeenEffectsStayWithinTheirBudget) {
  const DesignCaps& caps = kDesignCaps;
  EXPECT_LE(17 * caps.scout_runs + 3 + caps.main_most +
                caps.sequential_runs * caps.sequential_batches +
                caps.verification_runs * caps.verified_models,
            160);
}

}  // namespace
}  // namespace calib::diagnosis
