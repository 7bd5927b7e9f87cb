// Which batch comes next, and what may not follow what.
#include "server/diagnosis/design_stages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>

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

// What shows only just below where runs end is tried there, and no run is wasted beyond.
TEST_F(DesignStages, MainRunsStayWhereRunsOfAnEffectComeToTheirEnds) {
  EndedBatch ended = Made(NextBatch(chain_));
  const double near = std::min(ended.runs[1].run.values[3], ended.runs[4].run.values[3]);
  ended.runs[1].readings.reset();
  ended.runs[4].readings.reset();
  ASSERT_TRUE(chain_.Add(ended).ok());
  const RunBatch again = NextBatch(chain_);
  ASSERT_EQ(again.rows.size(), 2u);
  ASSERT_TRUE(chain_.Add(Made(again)).ok());
  const RunBatch main = NextBatch(chain_);
  EXPECT_EQ(main.stage, SamplePurpose::kMain);
  double most = 0;
  int uses = 0;
  for (const campaign::RunOf& run : main.rows) {
    most = std::max(most, run.values[3]);
    uses += run.values[3] > 0 ? 1 : 0;
  }
  EXPECT_GT(uses, 8);
  EXPECT_NEAR(most, near, 1e-9 * near);
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

// What is not allowed is not begun: a batch that was paid for and tells nothing helps nobody.
TEST_F(DesignStages, ABatchThatWouldExceedTheRunsAllowedIsNotMade) {
  ToyRunMaker maker(toy_, chain_.names());
  const absl::Status few = AnswerBy(chain_, maker, 8).status();
  EXPECT_EQ(few.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_THAT(few.message(), HasSubstr("effects apart are 9 with those of the stage scout"));
  EXPECT_THAT(few.message(), HasSubstr("8 are allowed"));
  EXPECT_EQ(maker.made(), 0);
  const absl::Status scout = AnswerBy(chain_, maker, 9).status();
  EXPECT_EQ(scout.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_THAT(scout.message(), HasSubstr("are 33 with those of the stage main"));
  EXPECT_EQ(maker.made(), 1);
  EXPECT_EQ(maker.batches()[0].runs.size(), 9U);
}

TEST_F(DesignStages, TooFewBaseRunsAreSaidWithTheNumberNeeded) {
  const auto chain =
      DesignChain::Create(RaceToy(3, 5, 20).Measured({}, 1), {.without = RaceToy::Without()});
  EXPECT_EQ(chain.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(chain.status().message(), HasSubstr("it takes 24 runs"));
}

// A campaign whose runs another code made. Measured: specimen `number`, its load cell read with a
// gain from the first reading on.
report::CampaignView MadeElsewhere(double gain, std::uint64_t number) {
  report::CampaignView view = RaceToy(1, 7, 96).Measured({.x = 0.4, .y = 0.6}, number);
  view.campaign.model = {};
  view.campaign.precomputed.emplace();
  for (campaign::Experiment& e : view.campaign.experiments) {
    e.specimens.clear();
    campaign::MeasuredObservable& stress = e.observables[0];
    const double start = stress.values.front();
    for (std::size_t i = 0; i < stress.values.size(); ++i) {
      stress.values[i] += gain * (stress.values[i] - start);
      stress.sd[i] = campaign::ErrorOf(*stress.noise, stress.values[i]);
    }
  }
  return view;
}

Answer AnswerAtOnce(DesignChain& chain) {
  const auto next = chain.Next();
  EXPECT_TRUE(next.ok()) << next.status();
  if (!next.ok() || !std::holds_alternative<Answer>(*next)) {
    ADD_FAILURE() << "a batch, and no answer";
    return {};
  }
  return std::get<Answer>(*next);
}

void ExpectFinite(const Answer& answer) {
  double sum = 0;
  for (const NamedModel& model : answer.probabilities) sum += model.probability;
  EXPECT_NEAR(sum, 1, 1e-9);
  EXPECT_TRUE(std::isfinite(answer.adequacy_p));
  for (const EffectAnswer& own : answer.candidates) {
    EXPECT_TRUE(std::isfinite(own.uncertain)) << own.effect;
    for (const auto& [name, value] : own.amplitude) EXPECT_TRUE(std::isfinite(value)) << name;
    for (const auto& [name, value] : own.visible) EXPECT_TRUE(std::isfinite(value)) << name;
  }
}

TEST(DesignStagesElsewhere, AnErrorOfTheLoadCellLeadsWithoutARun) {
  for (const std::uint64_t number : {1UL, 2UL}) {
    DesignChain chain = *DesignChain::Create(MadeElsewhere(0.25, number), {});
    const Answer answer = AnswerAtOnce(chain);
    ExpectFinite(answer);
    ASSERT_EQ(answer.candidates.size(), 3U);
    const EffectAnswer& first = answer.candidates.front();
    EXPECT_EQ(first.effect, "load_cell_error");
    EXPECT_GT(first.probability, 0.9);
    EXPECT_LT(answer.adequate, 0.05);
    EXPECT_TRUE(answer.runs.empty());
    EXPECT_THAT(chain.Add({.stage = SamplePurpose::kScout}).message(), HasSubstr("cannot follow"));
    // A negative offset is alike; of the second specimen the gain is the likelier strength.
    if (number == 2) {
      EXPECT_NEAR(first.amplitude.at("load_cell_error.gain"), 0.25, 0.1);
    }
  }
}

TEST(DesignStagesElsewhere, ARightModelIsAdequate) {
  for (const std::uint64_t number : {1UL, 2UL}) {
    DesignChain chain = *DesignChain::Create(MadeElsewhere(0, number), {});
    const Answer answer = AnswerAtOnce(chain);
    ExpectFinite(answer);
    EXPECT_EQ(answer.verdict, AnswerVerdict::kAdequate) << answer.sentence;
    EXPECT_GT(answer.adequacy_p, 0.01);
    EXPECT_GT(answer.adequate, 0.5);
    EXPECT_TRUE(answer.effects.empty());
  }
}

// The same campaign, whose tables hold runs with two effects. Measured with one of them.
report::CampaignView HoldsEffects(double strength, std::uint64_t number) {
  const RaceToy toy(2, 7, 96);
  report::CampaignView view =
      toy.Measured({.x = 0.4, .y = 0.6, .effect = 0, .units = strength / RaceToy::Unit(0)}, number);
  for (campaign::Experiment& e : view.campaign.experiments) e.specimens.clear();
  const campaign::Campaign design =
      CampaignOfDesign(view.campaign, *RaceOf(view, RaceToy::Without()));
  campaign::Precomputed runs;
  campaign::RunsWithEffects& with = runs.with_effects;
  std::vector<std::string> names;
  for (const campaign::CalibratedParameter& own : design.parameters) {
    names.push_back(own.name);
    if (own.name[0] == 'e') with.names.push_back(own.name);
  }
  const std::vector<std::string> all(names.begin(), names.begin() + 2 + std::ssize(with.names));
  constexpr int kRuns = 40;
  with.parameters.resize(kRuns, std::ssize(all));
  const inference::DataSet data = campaign::MakeDataSet(view.campaign);
  with.values.resize(view.campaign.experiments.size());
  for (int i = 0; i < kRuns; ++i) {
    campaign::RunOf run{.values = {}, .stream = 96 + i};
    for (std::size_t j = 0; j < all.size(); ++j) {
      const inference::Prior& prior = design.parameters[j].prior;
      const double at = std::fmod(0.5 + i * (0.7548776662 + 0.13 * static_cast<double>(j)), 1.0);
      const bool off = j >= 2 && i % 3 == static_cast<int>(j) - 2;
      run.values.push_back(off ? 0 : j < 2 ? prior.Quantile(at) : 0.05 + 0.9 * at);
    }
    with.parameters.row(i) =
        Eigen::Map<const Eigen::RowVectorXd>(run.values.data(), std::ssize(run.values));
    const Eigen::RowVectorXd readings = *toy.Made(run, all).readings;
    for (std::size_t e = 0; e < with.values.size(); ++e) {
      const campaign::Experiment& experiment = view.campaign.experiments[e];
      with.values[e].emplace_back(experiment.control.size() * experiment.observables.size());
      for (std::size_t t = 0; t < data.readings.size(); ++t) {
        const inference::Reading& own = data.readings[t];
        if (own.experiment != static_cast<int>(e)) continue;
        with.values[e]
            .back()[static_cast<std::size_t>(own.load_step) * experiment.observables.size() +
                    static_cast<std::size_t>(own.observable)] =
            readings[static_cast<Eigen::Index>(t)];
      }
    }
  }
  view.campaign.model.contact.clear();
  view.campaign.precomputed = std::move(runs);
  return view;
}

TEST(DesignStagesElsewhere, AnEffectThatRowsHoldIsNamedWithoutARun) {
  DesignChain chain = *DesignChain::Create(HoldsEffects(0.6, 1), {});
  const Answer answer = AnswerAtOnce(chain);
  ExpectFinite(answer);
  EXPECT_EQ(answer.verdict, AnswerVerdict::kMissingEffect) << answer.sentence;
  EXPECT_EQ(answer.effects, std::vector<std::string>{"e0"}) << answer.sentence;
  EXPECT_NEAR(answer.candidates.front().amplitude.at("e0.strength"), 0.6, 0.2);
  EXPECT_TRUE(answer.runs.empty());
  EXPECT_EQ(answer.borrowed_runs, 40);
}

TEST(DesignStagesElsewhere, RowsOfAnEffectThatIsLeftOutAreNotUsed) {
  DesignChain chain = *DesignChain::Create(HoldsEffects(0.6, 1), {.without = {"e1"}});
  const Answer answer = AnswerAtOnce(chain);
  ExpectFinite(answer);
  for (const EffectAnswer& own : answer.candidates) EXPECT_NE(own.effect, "e1");
  EXPECT_LT(answer.borrowed_runs, 40);
  EXPECT_GT(answer.borrowed_runs, 0);
}

TEST(DesignStagesElsewhere, WithoutAnEffectNoneThatRowsHoldIsNamed) {
  DesignChain chain = *DesignChain::Create(HoldsEffects(0, 2), {});
  const Answer answer = AnswerAtOnce(chain);
  EXPECT_EQ(answer.verdict, AnswerVerdict::kAdequate) << answer.sentence;
  EXPECT_GT(answer.adequate, 0.5);
}

// By the base's runs alone: nobody is in the race.
TEST(Adequacy, OfANullIsPassedAndOfAStrongEffectIsNot) {
  const RaceToy toy(1, 5);
  const auto judged = [&toy](const HiddenTruth& truth) {
    const auto answer = AdequacyOf(toy.Measured(truth, 1), 0.01);
    EXPECT_TRUE(answer.ok()) << answer.status();
    return answer.ok() ? *answer : Answer();
  };
  const Answer right = judged({.x = 0.3, .y = 0.7});
  EXPECT_EQ(right.verdict, AnswerVerdict::kAdequate);
  EXPECT_GE(right.adequacy_p, 0.01);
  EXPECT_TRUE(right.candidates.empty());
  EXPECT_TRUE(right.runs.empty());
  const Answer wrong = judged({.x = 0.3, .y = 0.7, .effect = 0, .units = 5});
  EXPECT_EQ(wrong.verdict, AnswerVerdict::kUnexplained);
  EXPECT_LT(wrong.adequacy_p, 0.01);
  EXPECT_GT(wrong.rms, right.rms);
  EXPECT_EQ(wrong.sentence,
            "The model misses the readings by more than noise and scatter explain.");
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
