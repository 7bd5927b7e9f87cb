#include "server/report/views/setting_trend.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "server/report/views/comparison.h"
#include "server/report/views/residual_words.h"

namespace calib::report {
namespace {

campaign::Experiment TestAt(double pressure, std::optional<double> rate) {
  campaign::Experiment e;
  e.settings = {{"confining_pressure", pressure}};
  e.loading_rate = rate;
  return e;
}

TEST(SettingTrend, FindsTheChangePerFactorTen) {
  const std::vector<campaign::Experiment> tests = {TestAt(1e5, 0.1), TestAt(1e6, 0.1),
                                                   TestAt(1e7, 0.1)};
  const auto trends =
      TrendsWithSettings({{&tests[0], 1.0, 0.1}, {&tests[1], 3.0, 0.1}, {&tests[2], 5.0, 0.1}});
  ASSERT_EQ(trends.size(), 1U);  // all have the same rate
  EXPECT_EQ(trends[0].with, "confining_pressure");
  EXPECT_NEAR(trends[0].per_decade, 2, 1e-9);
  EXPECT_NEAR(trends[0].sd, 0.1 / std::sqrt(2), 1e-9);
}

TEST(SettingTrend, TheRateOfLoadingIsASettingToo) {
  const std::vector<campaign::Experiment> tests = {TestAt(1e5, 0.01), TestAt(1e5, 1.0)};
  const auto trends = TrendsWithSettings({{&tests[0], 1.0, 0.1}, {&tests[1], 0.0, 0.1}});
  ASSERT_EQ(trends.size(), 1U);
  EXPECT_EQ(trends[0].with, "loading_rate");
  EXPECT_NEAR(trends[0].per_decade, -0.5, 1e-9);
}

TEST(SettingTrend, SaysNothingOfWhatOnlySomeOfThemHave) {
  const std::vector<campaign::Experiment> tests = {TestAt(1e5, 0.01), TestAt(1e5, std::nullopt)};
  EXPECT_TRUE(TrendsWithSettings({{&tests[0], 1.0, 0.1}, {&tests[1], 0.0, 0.1}}).empty());
  EXPECT_TRUE(TrendsWithSettings({}).empty());
}

// Two tests at different rates whose model is ten sd too high in the fast one alone.
TEST(SettingTrend, CompareTellsThatTheBiasGoesWithTheRate) {
  CampaignView view;
  for (int t = 0; t < 2; ++t) {
    campaign::Experiment e = TestAt(1e5, t == 0 ? 0.01 : 1.0);
    e.name = t == 0 ? "slow" : "fast";
    e.control_name = "axial_strain";
    StateHistory history{.observables = {"q_over_p"}, .states = {}};
    campaign::MeasuredObservable o{.name = "q_over_p", .values = {}, .sd = {}};
    for (int i = 0; i < 8; ++i) {
      e.control.push_back(0.01 * (i + 1));
      e.path.push_back({.target = e.control.back(), .load_step = i});
      e.segment.emplace_back("initial_loading");
      o.values.push_back(1);
      o.sd.push_back(0.05);
      v1::State state;
      state.set_load_step(i);
      state.add_values(1 + (t == 0 ? 0.001 : 0.5) + (i % 2 == 0 ? 0.01 : -0.01));
      history.states.push_back(state);
    }
    e.observables = {o};
    view.states[{e.name, 0}] = history;
    view.campaign.experiments.push_back(std::move(e));
  }
  v1::Sample sample;
  sample.set_weight(1);
  view.samples = {sample};
  view.campaign.parameters = {{"p", "1", {}}};
  const Comparison c = Compare(view, PredictReadings(view));
  ASSERT_EQ(c.trends.size(), 1U);
  EXPECT_EQ(c.trends[0].with, "loading_rate");
  EXPECT_NEAR(c.trends[0].per_decade, 0.499 / 2, 1e-6);
  EXPECT_THAT(WhereItFails(c), ::testing::Contains(::testing::HasSubstr(
                                   "model minus measurement grows with loading rate, by 0.25 per "
                                   "factor ten")));
}

}  // namespace
}  // namespace calib::report
