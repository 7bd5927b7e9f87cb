// The chain of a diagnosis on a simulator in closed form: what it says, how often it is right, what
// it costs; and that it says the same wherever it was interrupted.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <iostream>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "inference/sampling/philox.h"
#include "server/diagnosis/design_stages.h"
#include "tests/support/race_toy.h"

namespace calib::diagnosis {
namespace {

// Stated probabilities of effects against how often they act.
class Stated {
 public:
  void Add(double probability, bool acts) {
    for (std::size_t b = 0; b < kFrom.size(); ++b) {
      const double to = b + 1 < kFrom.size() ? kFrom[b + 1] : 1.1;
      if (probability < kFrom[b] || probability >= to) continue;
      ++count_[b];
      sum_[b] += probability;
      hits_[b] += acts ? 1 : 0;
    }
  }
  void Print() const {
    for (std::size_t b = 0; b < kFrom.size(); ++b) {
      if (count_[b] == 0) continue;
      std::cout << "stated from " << kFrom[b] << ": mean " << sum_[b] / count_[b] << ", observed "
                << static_cast<double>(hits_[b]) / count_[b] << " of " << count_[b] << "\n";
    }
  }
  /// Largest distance of observed from stated, in sd of chance.
  double Worst() const {
    double worst = 0;
    for (std::size_t b = 0; b < kFrom.size(); ++b) {
      if (count_[b] < 10) continue;
      const double p = sum_[b] / count_[b];
      worst = std::max(worst, std::abs(static_cast<double>(hits_[b]) / count_[b] - p) /
                                  std::sqrt((p * (1 - p) + 1e-3) / count_[b]));
    }
    return worst;
  }

 private:
  static constexpr std::array<double, 6> kFrom = {0, 0.05, 0.2, 0.5, 0.8, 0.95};
  std::array<int, 6> count_{}, hits_{};
  std::array<double, 6> sum_{};
};

struct Tally {
  int nulls = 0, adequate = 0, null_names = 0;
  int with = 0, right = 0, wrong = 0, covered = 0, family = 0, family_wrong = 0;
  double size = 0, log_truth = 0, runs = 0;
  std::map<std::string, double> by_stage;
  Stated stated;
};

std::string NameFor(const HiddenTruth& truth) {
  return truth.effect < 0 ? "" : RaceToy::NameOf(truth.effect);
}

void Judge(const Answer& answer, const HiddenTruth& truth, Tally& tally) {
  const std::string name = NameFor(truth);
  const bool null = truth.effect < 0;
  (null ? tally.nulls : tally.with) += 1;
  for (const EffectAnswer& own : answer.candidates) {
    tally.stated.Add(own.probability, own.effect == name);
    if (!own.alone) continue;
    if (null) {
      ++tally.null_names;
    } else {
      (own.effect == name ? tally.right : tally.wrong) += 1;
    }
  }
  if (null) tally.adequate += answer.verdict == AnswerVerdict::kAdequate ? 1 : 0;
  double truth_probability = null ? answer.adequate : 0;
  for (const NamedModel& model : answer.probabilities) {
    if (!null && model.effects == std::vector<std::string>{name})
      truth_probability = model.probability;
  }
  tally.log_truth += std::log(std::max(truth_probability, 1e-6));
  const bool holds =
      std::any_of(answer.credible_set.begin(), answer.credible_set.end(), [&](const auto& model) {
        return null ? model.effects.empty() && !model.none_of_these
                    : std::count(model.effects.begin(), model.effects.end(), name) > 0;
      });
  tally.covered += holds ? 1 : 0;
  // Distinct effects; base model and none of these count one.
  std::vector<std::string> distinct;
  for (const NamedModel& model : answer.credible_set) {
    std::vector<std::string> own = model.effects;
    if (own.empty()) own = {model.none_of_these ? "none" : "base"};
    for (const std::string& each : own) {
      if (std::count(distinct.begin(), distinct.end(), each) == 0) distinct.push_back(each);
    }
  }
  tally.size += static_cast<double>(distinct.size());
  for (const NamedFamily& family : answer.families) {
    const bool in = std::count(family.effects.begin(), family.effects.end(), name) > 0;
    (in ? tally.family : tally.family_wrong) += 1;
  }
  for (const auto& [stage, runs] : answer.runs) {
    tally.by_stage[stage] += runs;
    tally.runs += runs;
  }
}

void Print(const std::string& what, const Tally& tally) {
  const double n = tally.nulls + tally.with;
  std::cout << what << ": without effect " << tally.adequate << " of " << tally.nulls
            << " adequate, " << tally.null_names << " names; with effect " << tally.right << " of "
            << tally.with << " named right, " << tally.wrong << " wrong names, family at 0.95 "
            << tally.family << " right, " << tally.family_wrong << " wrong; the 95 % set holds the "
            << "truth in " << tally.covered << " of " << n << ", mean size " << tally.size / n
            << "; mean ln p(truth) " << tally.log_truth / n << "; mean runs " << tally.runs / n;
  for (const auto& [stage, runs] : tally.by_stage) std::cout << ", " << stage << " " << runs / n;
  std::cout << "\n";
  tally.stated.Print();
}

// Excited effects in turn, lambda from 21 to some 500.
HiddenTruth TruthOf(const RaceToy& toy, bool null, int number, unsigned seed) {
  inference::PhiloxStream stream(
      {.seed = seed, .iteration = 7, .sample = static_cast<std::uint64_t>(number)});
  HiddenTruth truth{.x = 0.1 + 0.8 * stream.Uniform(), .y = 0.1 + 0.8 * stream.Uniform()};
  if (null) return truth;
  truth.effect = number % (toy.effects() - 1);
  if (truth.effect >= 4) ++truth.effect;  // 4 is never excited
  truth.units = std::pow(5.0, stream.Uniform());
  if (truth.effect == 6) truth.units = std::min(truth.units, 2.5);
  if (RaceToy::HasBothSigns(truth.effect) && stream.Uniform() < 0.5) truth.units = -truth.units;
  return truth;
}

void Diagnose(const RaceToy& toy, const HiddenTruth& truth, std::uint64_t specimen, Tally& tally) {
  const std::clock_t start = std::clock();
  const report::CampaignView view = toy.Measured(truth, specimen);
  auto chain = DesignChain::Create(view, {.without = RaceToy::Without()});
  ASSERT_TRUE(chain.ok()) << chain.status();
  ToyRunMaker maker(toy, chain->names());
  const auto answer = AnswerBy(*chain, maker);
  ASSERT_TRUE(answer.ok()) << answer.status();
  const Tally before = tally;
  Judge(*answer, truth, tally);
  std::cout << "truth " << (truth.effect < 0 ? "nothing" : NameFor(truth)) << " at " << truth.units
            << ": " << answer->sentence << " (p " << answer->adequacy_p << ", "
            << static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC << " s; in the set "
            << tally.covered - before.covered << " of " << tally.size - before.size
            << ", ln p(truth) " << tally.log_truth - before.log_truth << ", "
            << tally.runs - before.runs << " runs)" << std::endl;
}

void Cases(const std::string& what, int effects, int nulls, int with, unsigned seed) {
  Tally tally;
  // A new base campaign and library for every twenty.
  for (int t = 0; t < nulls + with; ++t) {
    const RaceToy toy(effects, seed + static_cast<unsigned>(t / 20));
    // Nulls and effects take turns.
    const bool null = t % 2 == 0 ? t / 2 < nulls : t / 2 >= with;
    Diagnose(toy, TruthOf(toy, null, t / 2, seed), static_cast<std::uint64_t>(t), tally);
  }
  Print(what, tally);
  const double n = nulls + with;
  EXPECT_GE(tally.adequate, 0.95 * nulls - 2 * std::sqrt(0.0475 * nulls));
  EXPECT_LE(tally.null_names + tally.wrong, 0.02 * n + 2 * std::sqrt(0.02 * n));
  EXPECT_GE(tally.covered, 0.93 * n - 2 * std::sqrt(0.065 * n));
  EXPECT_LE(tally.runs / n, 160);
  EXPECT_LT(tally.stated.Worst(), 4);
}

// Everything that an answer says, to the bit.
std::string AllOf(const Answer& answer) {
  std::ostringstream text;
  text << std::hexfloat << ToString(answer.verdict) << answer.sentence << answer.adequate << " "
       << answer.none_of_these << " " << answer.adequacy_p;
  for (const NamedModel& model : answer.probabilities) {
    for (const std::string& effect : model.effects) text << " " << effect;
    text << " " << model.probability;
  }
  for (const EffectAnswer& own : answer.candidates) {
    text << "\n" << own.effect << own.probability << " " << own.uncertain << own.alone;
    for (const auto& [name, value] : own.amplitude) text << " " << name << value;
    for (const auto& [name, value] : own.visible) text << " " << name << value;
  }
  for (const auto& [stage, runs] : answer.runs) text << " " << stage << runs;
  return text.str();
}

TEST(DiagnosisChain, SaysTheSameWhereverItWasInterrupted) {
  const RaceToy toy(3, 11, 48);
  const report::CampaignView view = toy.Measured({.effect = 2, .units = -2}, 3);
  auto chain = DesignChain::Create(view, {.without = RaceToy::Without()});
  ASSERT_TRUE(chain.ok()) << chain.status();
  ToyRunMaker maker(toy, chain->names());
  const auto whole = AnswerBy(*chain, maker);
  ASSERT_TRUE(whole.ok()) << whole.status();
  const std::vector<EndedBatch>& made = maker.batches();
  ASSERT_GE(made.size(), 2u);
  for (std::size_t n = 0; n <= made.size(); ++n) {
    auto again = DesignChain::Create(view, {.without = RaceToy::Without()});
    ASSERT_TRUE(again.ok());
    ToyRunMaker rest(toy, again->names(),
                     {made.begin(), made.begin() + static_cast<std::ptrdiff_t>(n)});
    const auto answer = AnswerBy(*again, rest);
    ASSERT_TRUE(answer.ok()) << answer.status();
    EXPECT_EQ(AllOf(*answer), AllOf(*whole)) << "interrupted after batch " << n;
    EXPECT_EQ(rest.made(), static_cast<int>(made.size() - n)) << "no batch is made again";
  }
}

TEST(DiagnosisChain, NamesWhatIsHiddenAndNothingElse) { Cases("6 effects", 6, 3, 4, 1); }

// Cases of the seeds 1, 101 and 501 have served to mend the rules; these have not.
TEST(DiagnosisChainSlow, OfSixEffectsFirst) { Cases("6 effects", 6, 150, 150, 1001); }

TEST(DiagnosisChainSlow, OfSixEffectsSecond) { Cases("6 effects", 6, 150, 150, 301); }

TEST(DiagnosisChainSlow, OfSeventeenEffects) { Cases("17 effects", 17, 10, 10, 1501); }

}  // namespace
}  // namespace calib::diagnosis
