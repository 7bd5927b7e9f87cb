// The smooth misfit of a campaign: found where it is, not where there is only noise, carried to
// other tests, and said in a sentence.
#include "server/report/views/discrepancies.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

#include "server/report/documents/json_documents.h"
#include "server/report/views/residual_words.h"

namespace calib::report {
namespace {

using ::testing::HasSubstr;

constexpr int kReadingsOfCurve = 30;
constexpr double kNoise = 0.02;

campaign::Experiment Empty(const std::string& name, double pressure) {
  campaign::Experiment e;
  e.name = name;
  e.test = "triaxial_drained";
  e.settings = {{"confining_pressure", pressure}};
  e.control_name = "axial_strain";
  for (int i = 0; i < kReadingsOfCurve; ++i) {
    const double strain = 0.002 * (i + 1);
    e.control.push_back(strain);
    e.path.push_back({.target = strain, .load_step = i});
    e.segment.emplace_back(i < 20 ? "initial_loading" : "post_peak");
  }
  return e;
}

// q/p of 1 in the model at two pressures; measured is lower by a hump of this height at 4 % strain.
CampaignView View(double height) {
  CampaignView view;
  std::mt19937 random(4);
  std::normal_distribution<double> noise(0, kNoise);
  v1::Sample sample;
  sample.set_weight(1);
  for (const double pressure : {1e5, 3e5}) {
    campaign::Experiment e = Empty(pressure < 2e5 ? "low" : "high", pressure);
    campaign::MeasuredObservable o;
    o.name = "q_over_p";
    StateHistory history{.observables = {"q_over_p"}, .states = {}};
    for (int i = 0; i < kReadingsOfCurve; ++i) {
      const double away = (e.control[static_cast<std::size_t>(i)] - 0.04) / 0.015;
      o.values.push_back(1 - height * std::exp(-away * away) + noise(random));
      o.sd.push_back(kNoise);
      v1::State state;
      state.set_load_step(i);
      state.add_values(1);
      history.states.push_back(state);
    }
    e.observables = {o};
    view.states[{e.name, 0}] = history;
    view.campaign.experiments.push_back(e);
  }
  view.campaign.parameters = {{"p", "1", {}}};
  view.samples = {sample};
  return view;
}

Comparison Compared(const CampaignView& view) {
  const auto predictions = PredictReadings(view);
  Comparison comparison = Compare(view, predictions);
  AddDiscrepancies(view, predictions, comparison);
  return comparison;
}

TEST(Discrepancies, ASmoothMisfitIsFoundWhereItIs) {
  const Comparison c = Compared(View(0.15));
  ASSERT_EQ(c.discrepancies.size(), 2U);
  const ObservableDiscrepancy& d = c.discrepancies[0];
  EXPECT_EQ(d.experiment, "low");
  EXPECT_EQ(d.experiments, 2);
  EXPECT_GT(d.probability, 0.999);
  EXPECT_NEAR(d.largest_at, 0.04, 0.005);
  EXPECT_NEAR(d.mean[d.largest], 0.15, 0.03);  // the model is too high
  EXPECT_NEAR(d.mean[0], 0, 0.03);
  EXPECT_GT(d.alike, 0.7);
  const auto sentences = WhereItFails(c);
  EXPECT_THAT(sentences, ::testing::Contains(::testing::AllOf(
                             HasSubstr("low, "), HasSubstr("a smooth misfit of about"),
                             HasSubstr("largest at"), HasSubstr("the model is too high by 0.1"),
                             HasSubstr("much the same in all experiments"))));
  const auto json = nlohmann::json::parse(ComparisonJson("c1", c));
  ASSERT_EQ(json["discrepancy"].size(), 2U);
  EXPECT_EQ(json["discrepancy"][0]["mean"].size(), static_cast<std::size_t>(kReadingsOfCurve));
}

TEST(Discrepancies, NoiseAloneIsNotSpokenOf) {
  const Comparison c = Compared(View(0));
  ASSERT_EQ(c.discrepancies.size(), 2U);
  EXPECT_LT(c.discrepancies[0].probability, 0.95);
  for (const double m : c.discrepancies[0].mean) EXPECT_LT(std::abs(m), kNoise);
  for (const std::string& sentence : WhereItFails(c)) {
    EXPECT_THAT(sentence, ::testing::Not(HasSubstr("smooth misfit")));
  }
}

TEST(Discrepancies, OtherTestsInheritThem) {
  const CampaignView view = View(0.15);
  const auto fitted = FitDiscrepancies(view, PredictReadings(view));
  ASSERT_EQ(fitted.size(), 1U);
  const Eigen::VectorXd model = Eigen::VectorXd::Ones(kReadingsOfCurve);
  const auto at = [&](const campaign::Experiment& e, const std::string& observable) {
    return DiscrepancyAt(view, fitted, e, observable, model);
  };
  const auto again = at(Empty("again", 1e5), "q_over_p");
  const auto further = at(Empty("further", 2e5), "q_over_p");
  ASSERT_EQ(again.mean.size(), kReadingsOfCurve);
  EXPECT_NEAR(again.rms[19], 0.15, 0.03);
  EXPECT_NEAR(further.rms[19], 0.15, 0.05);
  EXPECT_LT(again.sd[19], further.sd[19]) << "a new experiment is known less well";
  EXPECT_EQ(at(Empty("other", 1e5), "porosity").mean.size(), 0);
  // Twice the curve, twice the misfit.
  const auto larger = DiscrepancyAt(view, fitted, Empty("x", 2e5), "q_over_p", 2 * model);
  EXPECT_NEAR(larger.rms[19], 2 * further.rms[19], 1e-9);
}

TEST(Discrepancies, WithoutStatedErrorsNothingIsSaid) {
  CampaignView view = View(0.15);
  view.campaign.filter.noise = inference::NoiseMode::kInferred;
  EXPECT_TRUE(Compared(view).discrepancies.empty());
}

}  // namespace
}  // namespace calib::report
