// Runs of another campaign's design: whose they may be, and how the chain goes on with them.
#include "server/diagnosis/borrowed_design.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "server/diagnosis/design_stages.h"
#include "tests/support/race_toy.h"

namespace calib::diagnosis {
namespace {

using campaign::SamplePurpose;
using ::testing::HasSubstr;

class BorrowedDesign : public ::testing::Test {
 protected:
  BorrowedDesign() {
    ToyRunMaker maker(toy_, maker_chain_.names());
    const auto answer = AnswerBy(maker_chain_, maker);
    EXPECT_TRUE(answer.ok()) << answer.status();
    design_ = RaceToy::Stored(first_, maker_chain_.race(), maker.batches());
    made_ = maker.batches();
  }
  DesignQuestion Question(std::vector<std::string> without = {}) const {
    std::vector<std::string> all = RaceToy::Without();
    all.insert(all.end(), without.begin(), without.end());
    return {.without = all, .other = OtherDesign{.design = &design_, .base = &first_}};
  }
  DesignChain Chain(const report::CampaignView& view, std::vector<std::string> without = {}) const {
    auto chain = DesignChain::Create(view, Question(std::move(without)));
    EXPECT_TRUE(chain.ok()) << chain.status();
    return *std::move(chain);
  }
  int MadeInAll() const {
    int runs = 0;
    for (const EndedBatch& batch : made_) runs += static_cast<int>(batch.runs.size());
    return runs;
  }

  RaceToy toy_{3, 11, 48};
  report::CampaignView first_ = toy_.Measured({}, 3);
  report::CampaignView second_ = toy_.Measured({.effect = 2, .units = -3}, 4);
  DesignChain maker_chain_ = *DesignChain::Create(first_, {.without = RaceToy::Without()});
  report::CampaignView design_;
  std::vector<EndedBatch> made_;
};

TEST_F(BorrowedDesign, ServesAnotherMeasurementOfTheSameTests) {
  DesignChain chain = Chain(second_);
  ToyRunMaker maker(toy_, chain.names());
  const auto answer = AnswerBy(chain, maker);
  ASSERT_TRUE(answer.ok()) << answer.status();
  EXPECT_EQ(answer->borrowed_runs, MadeInAll());
  EXPECT_EQ(answer->candidates.front().effect, "e2") << answer->sentence;
  EXPECT_GT(answer->candidates.front().probability, 0.9);
  int own = 0, first_stream = 48;
  for (const EndedBatch& batch : made_) {
    for (const EndedRun& run : batch.runs)
      first_stream = std::max(first_stream, run.run.stream + 1);
  }
  ASSERT_FALSE(maker.batches().empty());
  EXPECT_EQ(maker.batches()[0].runs[0].run.stream, first_stream) << "chance of its own";
  for (const EndedBatch& batch : maker.batches()) {
    EXPECT_TRUE(batch.stage == SamplePurpose::kSequential ||
                batch.stage == SamplePurpose::kVerification);
    own += static_cast<int>(batch.runs.size());
  }
  int said = 0;
  for (const auto& [stage, runs] : answer->runs) said += runs;
  EXPECT_EQ(said, own) << "runs that were made for another one do not count";

  // Interrupted after any batch it says the same.
  for (std::size_t n = 0; n <= maker.batches().size(); ++n) {
    DesignChain again = Chain(second_);
    ToyRunMaker rest(
        toy_, again.names(),
        {maker.batches().begin(), maker.batches().begin() + static_cast<std::ptrdiff_t>(n)});
    const auto same = AnswerBy(again, rest);
    ASSERT_TRUE(same.ok()) << same.status();
    EXPECT_EQ(same->sentence, answer->sentence);
    EXPECT_EQ(same->candidates.front().probability, answer->candidates.front().probability);
  }
}

TEST_F(BorrowedDesign, RunsInWhichAnEffectActsThatIsLeftOutAreNotUsed) {
  DesignChain chain = Chain(second_, {"e0"});
  EXPECT_THAT(chain.race().Names(), ::testing::ElementsAre("e1", "e2"));
  ToyRunMaker maker(toy_, chain.names());
  const auto answer = AnswerBy(chain, maker);
  ASSERT_TRUE(answer.ok()) << answer.status();
  int without = 0;
  const std::vector<std::string>& names = maker_chain_.names();
  const auto column = std::find(names.begin(), names.end(), "e0.strength") - names.begin();
  for (const EndedBatch& batch : made_) {
    for (const EndedRun& run : batch.runs)
      without += run.run.values[static_cast<std::size_t>(column)] == 0 ? 1 : 0;
  }
  EXPECT_LT(without, MadeInAll());
  EXPECT_EQ(answer->borrowed_runs, without);
  EXPECT_EQ(answer->candidates.front().effect, "e2");
  const auto is_e0 = [](const auto& own) { return own.effect == "e0"; };
  EXPECT_TRUE(std::none_of(answer->candidates.begin(), answer->candidates.end(), is_e0));
}

TEST_F(BorrowedDesign, OfFewerEffectsLeavesTheOthersOut) {
  std::vector<std::string> without = RaceToy::Without();
  without.emplace_back("e1");
  DesignChain fewer = *DesignChain::Create(first_, {.without = without});
  ToyRunMaker maker(toy_, fewer.names());
  ASSERT_TRUE(AnswerBy(fewer, maker).ok());
  design_ = RaceToy::Stored(first_, fewer.race(), maker.batches());
  DesignChain chain = Chain(second_);
  EXPECT_THAT(chain.race().Names(), ::testing::ElementsAre("e0", "e2"));
  EXPECT_EQ(chain.race().not_excitable.back().first, "e1");
  EXPECT_EQ(chain.race().not_excitable.back().second, "the runs of c2 were made without it");
}

TEST_F(BorrowedDesign, RunsOfItsBaseThatTheCampaignHasNotAreTakenToo) {
  // The campaign has half of the runs of the design's base, and not the one that its numerics
  // repeat.
  report::CampaignView half = second_;
  half.samples.clear();
  for (const v1::Sample& sample : second_.samples) {
    if (sample.index() % 2 == 0) {
      half.samples.push_back(sample);
    } else {
      half.states.erase({"low", sample.index()});
      half.states.erase({"high", sample.index()});
    }
  }
  DesignChain chain = Chain(half);
  ToyRunMaker maker(toy_, chain.names());
  const auto answer = AnswerBy(chain, maker);
  ASSERT_TRUE(answer.ok()) << answer.status();
  EXPECT_EQ(answer->borrowed_runs, MadeInAll() + 24);
}

TEST_F(BorrowedDesign, OfOtherRunsIsRefusedWithWhatDiffers) {
  EXPECT_EQ(WhyOtherRuns(second_.campaign, design_.campaign), "");
  const auto why = [this](const auto& change) {
    report::CampaignView other = second_;
    change(other.campaign);
    return std::string(DesignChain::Create(other, Question()).status().message());
  };
  EXPECT_EQ(
      why([](auto& c) { c.experiments[1].settings["confining_pressure"] = 3e5; }),
      "the runs of c2 are not of the tests and the model of c1: `settings` of high is another");
  EXPECT_THAT(why([](auto& c) { c.parameters[0].prior.max = 2e9; }),
              HasSubstr("the prior of young_modulus is another one"));
  EXPECT_THAT(why([](auto& c) { c.experiments[0].specimens.resize(4); }),
              HasSubstr("the number of packings of low is another"));
  EXPECT_THAT(why([](auto& c) { c.experiments[0].path.back().target *= 2; }),
              HasSubstr("`path` of low is another"));
  EXPECT_THAT(why([](auto& c) { c.experiments[0].observables[0].name = "axial_stress"; }),
              HasSubstr("what is read of low is another"));
  EXPECT_THAT(why([](auto& c) { c.model.density = 2600; }), HasSubstr("`density` of low"));
  EXPECT_THAT(why([](auto& c) { c.model.user_effects[0].formula = "2"; }),
              HasSubstr("user_effects are others"));
  EXPECT_THAT(why([](auto& c) { c.experiments.pop_back(); }),
              HasSubstr("1 tests are fitted here and 2 there"));
}

TEST_F(BorrowedDesign, WithoutAMainStageIsRefused) {
  design_ = RaceToy::Stored(first_, maker_chain_.race(), {made_[0]});
  EXPECT_THAT(DesignChain::Create(second_, Question()).status().message(),
              HasSubstr("the design c2 has no runs of the stage main"));
}

}  // namespace
}  // namespace calib::diagnosis
