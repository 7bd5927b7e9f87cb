// What an answer says of effects beyond their probabilities, on a simulator in closed form.
#include "server/diagnosis/design_effects.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <map>
#include <string>
#include <vector>

#include "server/diagnosis/design_caps.h"
#include "server/diagnosis/design_stages.h"
#include "tests/support/race_toy.h"

namespace calib::diagnosis {
namespace {

using ::testing::Key;
using ::testing::UnorderedElementsAre;

const RaceToy& ToyOfFour() {
  static const RaceToy toy(4, 5, 60);
  return toy;
}

double SdOfDeparture(double strain, bool unloads) {
  const double c = std::cos(3 * strain), d = std::cos(6 * strain), u = unloads ? 0.5 : 0;
  return RaceToy::kScatter *
         std::sqrt(std::pow(std::tanh(8 * strain), 2) * (1 + c * c + d * d) + u * u);
}

// The measurement, with what its campaign knows of scatter: that of the toy, of packing and run.
report::CampaignView MeasuredWithScatter(const HiddenTruth& truth) {
  report::CampaignView view = ToyOfFour().Measured(truth, 1);
  for (const campaign::Experiment& e : view.campaign.experiments) {
    for (const campaign::MeasuredObservable& own : e.observables) {
      v1::Posterior::Scatter& record = *view.posterior.add_scatter();
      record.set_experiment(e.name);
      record.set_observable(own.name);
      record.set_from("realizations");
      record.set_runs(RaceToy::kPackings);
      record.set_share(1);
      for (std::size_t i = 0; i < own.values.size(); ++i) {
        const double sd = std::sqrt(2) * SdOfDeparture(e.control[i], e.segment[i] == "unload_1");
        record.add_sd(own.noise->relative > 0 ? sd * own.values[i] : sd);
      }
    }
  }
  return view;
}

struct ToldOfToy {
  report::CampaignView view;
  std::vector<std::string> names;  // of the design's parameters
  Answer answer;
};

ToldOfToy TellOf(const HiddenTruth& truth) {
  ToldOfToy told{.view = MeasuredWithScatter(truth), .names = {}, .answer = {}};
  auto chain = DesignChain::Create(told.view, {.without = RaceToy::Without()});
  EXPECT_TRUE(chain.ok()) << chain.status();
  if (!chain.ok()) return told;
  told.names = chain->names();
  ToyRunMaker maker(ToyOfFour(), told.names);
  auto answer = AnswerBy(*chain, maker);
  EXPECT_TRUE(answer.ok()) << answer.status();
  if (answer.ok()) told.answer = *std::move(answer);
  return told;
}

// A chain takes a second or two: one for all that is asked of it.
constexpr double kHiddenStrength = 0.3;
const ToldOfToy& OfEffect() {
  static const ToldOfToy told =
      TellOf({.x = 0.4, .y = 0.6, .effect = 0, .units = kHiddenStrength / RaceToy::Unit(0)});
  return told;
}
const ToldOfToy& OfNull() {
  static const ToldOfToy told = TellOf({.x = 0.4, .y = 0.6});
  return told;
}

const EffectAnswer& CandidateOf(const Answer& answer, const std::string& effect) {
  const auto found = std::find_if(answer.candidates.begin(), answer.candidates.end(),
                                  [&](const EffectAnswer& own) { return own.effect == effect; });
  EXPECT_NE(found, answer.candidates.end()) << effect;
  return found == answer.candidates.end() ? answer.candidates.front() : *found;
}

const NamedModel& ModelOfNames(const Answer& answer, const std::vector<std::string>& effects) {
  const auto found = std::find_if(
      answer.probabilities.begin(), answer.probabilities.end(),
      [&](const NamedModel& own) { return !own.none_of_these && own.effects == effects; });
  EXPECT_NE(found, answer.probabilities.end());
  return found == answer.probabilities.end() ? answer.probabilities.front() : *found;
}

// Root mean square over all readings of what the curves miss, in sd of their noise.
double Missed(const report::CampaignView& view, const Eigen::RowVectorXd& readings) {
  const inference::DataSet data = campaign::MakeDataSet(view.campaign);
  double sum = 0;
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    const inference::Reading& own = data.readings[k];
    sum += std::pow((own.value - readings[static_cast<Eigen::Index>(k)]) / own.sd, 2);
  }
  return std::sqrt(sum / static_cast<double>(data.readings.size()));
}

TEST(DesignEffects, AHiddenEffectComesClosestWithItsStrength) {
  const Answer& answer = OfEffect().answer;
  ASSERT_EQ(answer.candidates.size(), 4U);
  const EffectAnswer& own = answer.candidates.front();
  EXPECT_EQ(own.effect, "e0");
  EXPECT_LT(own.p_value, 1e-4);
  EXPECT_LT(own.rms, answer.rms);
  EXPECT_GT(own.explained, 0.9);
  for (const char* other : {"e1", "e2", "e3"}) {
    const EffectAnswer& rival = CandidateOf(answer, other);
    EXPECT_LT(own.rms, rival.rms) << other;
    EXPECT_LT(own.p_value, rival.p_value) << other;
    EXPECT_LT(rival.explained, own.explained) << other;
    EXPECT_GE(rival.explained, 0) << other;
  }
  // Three sd of the posterior that is stated beside it.
  const campaign::FirstProposal::Place stated =
      ModelOfNames(answer, {"e0"}).posterior.at("e0.strength");
  EXPECT_NEAR(own.amplitude.at("e0.strength"), kHiddenStrength, 3 * stated.sd);
  EXPECT_NEAR(stated.center, own.amplitude.at("e0.strength"), stated.sd) << "mean and median";
  EXPECT_GT(stated.sd, 0);
  EXPECT_LT(stated.sd, 0.2 * kHiddenStrength);
}

// e1 is 15 degrees from e0, the others far from both.
TEST(DesignEffects, ASiblingIsVerifiedHoweverImprobable) {
  const Answer answer = TellOf({.x = 0.4, .y = 0.6, .effect = 0, .units = 9}).answer;
  ASSERT_EQ(answer.effects, std::vector<std::string>{"e0"}) << answer.sentence;
  EXPECT_LT(ModelOfNames(answer, {"e1"}).probability, kDesignCaps.sibling);
  EXPECT_EQ(answer.runs.at("verification"), 2 * kDesignCaps.verification_runs);
}

TEST(DesignEffects, PointsOfAModelHaveItsParametersAndNoOthers) {
  const Answer& answer = OfEffect().answer;
  const NamedModel& with = ModelOfNames(answer, {"e0"});
  ASSERT_EQ(with.points.size(), 3U);
  for (const auto& point : with.points) {
    EXPECT_THAT(point, UnorderedElementsAre(Key("young_modulus"), Key("friction_angle"),
                                            Key("e0.strength")));
  }
  EXPECT_THAT(with.posterior, UnorderedElementsAre(Key("young_modulus"), Key("friction_angle"),
                                                   Key("e0.strength")));
  const NamedModel& base = ModelOfNames(answer, {});
  ASSERT_EQ(base.points.size(), 3U) << "asked for however improbable: rivals are told from it";
  for (const auto& point : base.points) {
    EXPECT_THAT(point, UnorderedElementsAre(Key("young_modulus"), Key("friction_angle")));
    EXPECT_GE(point.at("young_modulus"), 0.4e9);
    EXPECT_LE(point.at("young_modulus"), 1.8e9);
  }
  for (const NamedModel& model : answer.probabilities) {
    if (!model.none_of_these) continue;
    EXPECT_TRUE(model.points.empty()) << "it has no parameters of its own";
  }
  // Medians of shapes stand beside those of strengths.
  EXPECT_THAT(CandidateOf(answer, "e3").amplitude,
              UnorderedElementsAre(Key("e3.strength"), Key("e3.form")));
}

// What the simulator misses at the base's best point, as a mean over runs, and with the change.
// What is left is the specimen's own: three sd of the noise by its scatter, one by its noise.
TEST(DesignEffects, ChangesOfCurvesTakeAwayWhatTheBaseMisses) {
  const ToldOfToy& told = OfEffect();
  const std::map<std::string, double>& best = ModelOfNames(told.answer, {}).points.front();
  campaign::RunOf run{.values = std::vector<double>(told.names.size(), 0)};
  for (std::size_t j = 0; j < told.names.size(); ++j) {
    if (const auto found = best.find(told.names[j]); found != best.end())
      run.values[j] = found->second;
    if (told.names[j].rfind("numerics.", 0) == 0) run.values[j] = 1;
  }
  constexpr int kRuns = 32;  // four on each packing
  Eigen::RowVectorXd readings = Eigen::RowVectorXd::Zero(4 * RaceToy::kReadings);
  for (run.stream = 1000; run.stream < 1000 + kRuns; ++run.stream)
    readings += *ToyOfFour().Made(run, told.names).readings / kRuns;
  const EffectAnswer& own = told.answer.candidates.front();
  ASSERT_EQ(own.curves.size(), 4U);
  Eigen::RowVectorXd changed = readings;
  for (const ChangedCurve& curve : own.curves) {
    ASSERT_EQ(curve.change.size(), static_cast<std::size_t>(RaceToy::kReadings));
    const int experiment = curve.experiment == "low" ? 0 : 1;
    const int observable = curve.observable == "deviatoric_stress" ? 0 : 1;
    for (int i = 0; i < RaceToy::kReadings; ++i) {
      changed[2 * (RaceToy::kReadings * experiment + i) + observable] +=
          curve.change[static_cast<std::size_t>(i)];
    }
  }
  const double before = Missed(told.view, readings), after = Missed(told.view, changed);
  std::cout << "missed " << before << " without the effect, " << after
            << " with it, in sd of noise\n";
  EXPECT_LT(after, 0.7 * before);
  EXPECT_TRUE(CandidateOf(told.answer, "e3").curves.empty()) << "not asked for";
}

// The toy turns the second effect by 15 degrees from the first; parameters take some of that away.
TEST(DesignEffects, AnglesAndVisibleStrengthsAreThoseOfTheSignatures) {
  const Answer& answer = OfEffect().answer;
  const EffectAnswer& own = CandidateOf(answer, "e0");
  EXPECT_THAT(own.angles, UnorderedElementsAre(Key("e1"), Key("e2"), Key("e3")));
  EXPECT_LT(own.angles.at("e1"), 25);
  EXPECT_GT(own.angles.at("e2"), 60);
  EXPECT_EQ(own.angles.at("e1"), CandidateOf(answer, "e1").angles.at("e0"));
  for (int k = 0; k < 4; ++k) {
    // A unit is what the toy changes by one and a half sd of scatter: seen from about there on.
    const EffectAnswer& effect = CandidateOf(answer, RaceToy::NameOf(k));
    ASSERT_THAT(effect.visible, UnorderedElementsAre(Key(effect.effect + ".strength")));
    const double units = effect.visible.begin()->second / RaceToy::Unit(k);
    EXPECT_GT(units, 0.3) << k;
    EXPECT_LT(units, 3) << k;
  }
}

TEST(DesignEffects, OfANullNoneIsSignificant) {
  const Answer& answer = OfNull().answer;
  EXPECT_EQ(answer.verdict, AnswerVerdict::kAdequate) << answer.sentence;
  ASSERT_EQ(answer.candidates.size(), 4U);
  for (const EffectAnswer& own : answer.candidates) {
    EXPECT_GT(own.p_value, 1e-3) << own.effect;
    EXPECT_LE(own.p_value, 1) << own.effect;
  }
  // A right model is as far off as a measurement scatters; of its few directions some 20 %.
  EXPECT_NEAR(answer.rms, 1, 0.5);
  EXPECT_GT(answer.p_square, 0.01);
}

// What an emulator does not know of an effect makes its own error larger, and is no evidence.
TEST(DesignEffects, ASmallPValueStandsBesideASmallerError) {
  for (const Answer* answer : {&OfEffect().answer, &OfNull().answer}) {
    for (const EffectAnswer& own : answer->candidates) {
      if (own.p_value < 0.05) {
        EXPECT_LT(own.rms, 1.05 * answer->rms) << own.effect << ": emulators of base and design";
      }
    }
  }
}

TEST(DesignEffects, ASecondSpecimenPromisesAProbability) {
  const double of_effect = OfEffect().answer.repeat_names_alone;
  const double of_null = OfNull().answer.repeat_names_alone;
  EXPECT_GE(of_null, 0);
  EXPECT_LE(of_effect, 1);
  EXPECT_GT(of_effect, of_null);
  std::cout << "a second specimen names: " << of_effect << ", of a null " << of_null << "\n";
}

}  // namespace
}  // namespace calib::diagnosis
