#include "server/report/views/comparison.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "inference/scatter/chi_squared_law.h"
#include "server/report/views/weighted_statistics.h"
#include "tests/unit/report/example_view.h"

namespace calib::report {
namespace {

// Four readings of one observable with known residuals (model - measured = +1, -1, +1, -1 standard
// deviations).
CampaignView FourReadings(double correlation_length) {
  CampaignView view;
  campaign::Experiment e;
  e.name = "a";
  e.control_name = "axial_strain";
  campaign::MeasuredObservable o{
      .name = "q_over_p", .values = {1, 2, 3, 4}, .sd = {0.5, 0.5, 0.5, 0.5}};
  o.correlation_length = correlation_length;
  v1::Sample sample;
  sample.set_weight(1);
  StateHistory history{.observables = {"q_over_p"}, .states = {}};
  for (int i = 0; i < 4; ++i) {
    e.control.push_back(0.01 * (i + 1));
    e.path.push_back({.target = 0.01 * (i + 1), .load_step = i});
    e.segment.emplace_back(i < 2 ? "initial_loading" : "post_peak");
    v1::State state;
    state.set_load_step(i);
    state.add_values(i + 1 + (i % 2 == 0 ? 0.5 : -0.5));
    history.states.push_back(state);
  }
  e.observables = {o};
  view.campaign.experiments = {e};
  view.campaign.parameters = {{"p", "1", {}}};
  view.samples = {sample};
  view.states[{"a", 0}] = history;
  return view;
}

TEST(Comparison, IndependentErrors) {
  const CampaignView view = FourReadings(0);
  const Comparison c = Compare(view, PredictReadings(view));
  EXPECT_NEAR(c.rms_error, 1, 1e-9);
  EXPECT_NEAR(*c.reduced_chi2, 4.0 / 3, 1e-6);
  EXPECT_NEAR(*c.p_value, 0.2615, 1e-4);  // chi-squared of 4 at 3 degrees of freedom
  EXPECT_NEAR(*c.by_observable[0].p_value, 0.4060, 1e-4);  // at 4
  ASSERT_EQ(c.by_segment.size(), 2U);
  EXPECT_EQ(c.by_segment[0].segment, "initial_loading");
  EXPECT_NEAR(c.by_segment[0].bias, 0, 1e-12);
  EXPECT_FALSE(c.heldout_rms_error.has_value());
}

// As the noise in size; residuals of three sd of it.
Comparison WithScatterFrom(const char* from, int runs) {
  CampaignView view = FourReadings(0);
  for (v1::State& state : view.states[{"a", 0}].states) {
    const double measured = state.load_step() + 1;
    state.set_values(0, measured + 3 * (state.values(0) - measured));
  }
  view.posterior.set_posterior_from("weights");
  v1::Posterior::Scatter& scatter = *view.posterior.add_scatter();
  scatter.set_experiment("a");
  scatter.set_observable("q_over_p");
  for (int i = 0; i < 4; ++i) {
    scatter.add_load_step(i);
    scatter.add_sd(0.5);
  }
  scatter.set_share(1);
  scatter.set_from(from);
  scatter.set_runs(runs);
  return Compare(view, PredictReadings(view));
}

// Chi-squared is 18 by noise and scatter of the specimen alike; what is known of that sum makes it
// more or less rare.
TEST(Comparison, ScatterOfTwinsIsKnownFromAsManyAndTheirMeanIsNotOffByIt) {
  const auto p = [](const char* from, int runs) {
    return *WithScatterFrom(from, runs).by_observable[0].p_value;
  };
  EXPECT_NEAR(p("emulator", 100), inference::UpperTail(18, 4, {}), 1e-9);
  const inference::KnownFrom four{.readings = 4, .scatter = 4 * 0.25, .packings = 4};
  EXPECT_NEAR(p("repeats", 4), inference::UpperTail(18, 4, four), 1e-9);
  EXPECT_GT(p("repeats", 4), 5 * p("emulator", 100));
  EXPECT_NEAR(p("repeats", 4000) / p("emulator", 100), 1, 0.1);
  EXPECT_GT(p("realizations", 4), p("repeats", 4)) << "a quarter of it in the mean";
  EXPECT_EQ(WithScatterFrom("repeats", 4).rms_error, WithScatterFrom("emulator", 100).rms_error);
}

TEST(Comparison, WhatTheRecordSaysOfAStageOverDrawsGoesBeforeThePosteriorMean) {
  CampaignView view = FourReadings(0);
  v1::Posterior::StageP& stage = *view.posterior.add_stage_p();
  stage.set_experiment("a");
  stage.set_observable("q_over_p");
  stage.set_first(2);
  stage.set_last(3);
  stage.set_p(0.03);
  const Comparison c = Compare(view, PredictReadings(view));
  ASSERT_EQ(c.by_segment.size(), 2U);
  EXPECT_EQ(c.by_segment[1].predictive_p, 0.03);
  EXPECT_EQ(c.by_segment[1].p_value, 0.03);
  EXPECT_FALSE(c.by_segment[0].predictive_p);
  EXPECT_NEAR(*c.by_segment[0].p_value, std::exp(-1), 1e-6);  // chi-squared of 2 at 2
  EXPECT_FALSE(c.by_observable[0].predictive_p);
}

TEST(Comparison, CorrelatedErrorsMakeAlternatingResidualsUnlikely) {
  const CampaignView view = FourReadings(0.05);
  EXPECT_GT(*Compare(view, PredictReadings(view)).reduced_chi2, 4.0);
}

TEST(Comparison, SaysNothingOfAdequacyWithoutAnIndependentErrorScale) {
  CampaignView view = FourReadings(0);
  view.campaign.filter.noise = inference::NoiseMode::kInferred;
  const Comparison c = Compare(view, PredictReadings(view));
  EXPECT_FALSE(c.p_value.has_value());
  EXPECT_FALSE(c.by_observable[0].z.has_value());
  EXPECT_FALSE(c.note.empty());
}

TEST(Comparison, HeldOutDataAreReportedApart) {
  const CampaignView view = testing::ExampleView("x");
  const Comparison c = Compare(view, PredictReadings(view));
  ASSERT_TRUE(c.heldout_rms_error.has_value());
  EXPECT_NEAR(c.rms_error, 1, 0.3);
  EXPECT_DOUBLE_EQ(c.by_observable[0].effective_readings, 40);  // independent
  EXPECT_LT(c.by_observable[1].effective_readings, 30);
  double share = 0;
  for (const SegmentMisfit& m : c.by_segment) {
    if (!m.heldout) share += *m.chi2_share;
  }
  EXPECT_NEAR(share, 1, 1e-12);
}

// Draws from a posterior that knows the model up to a shift: how far the prediction may be off by
// it belongs to the errors of what was not fitted.
TEST(Comparison, HeldOutReadingsOfARightModelAreAsUnlikelyAsTheySay) {
  constexpr int kTimes = 400;
  constexpr int kRuns = 20;
  int below = 0;
  int segments_below = 0;
  std::mt19937_64 engine(5);
  std::normal_distribution<double> normal;
  for (int time = 0; time < kTimes; ++time) {
    CampaignView view = FourReadings(0);
    campaign::Experiment& held = view.campaign.experiments.front();
    held.role = campaign::Role::kValidate;
    const double shift = normal(engine);
    for (std::size_t i = 0; i < 4; ++i) {
      held.observables[0].values[i] = static_cast<double>(i + 1) + shift + 0.5 * normal(engine);
    }
    view.samples.assign(kRuns, view.samples.front());
    const StateHistory pattern = view.states[{"a", 0}];
    for (int run = 0; run < kRuns; ++run) {
      view.samples[static_cast<std::size_t>(run)].set_index(run);
      const double own = normal(engine);
      StateHistory history = pattern;
      for (int i = 0; i < 4; ++i) {
        history.states[static_cast<std::size_t>(i)].set_values(0, i + 1 + own);
      }
      view.states[{"a", run}] = history;
    }
    const Comparison c = Compare(view, PredictReadings(view));
    below += *c.by_observable[0].p_value < 0.05 ? 1 : 0;
    segments_below += *c.by_segment[1].p_value < 0.05 ? 1 : 0;
  }
  // Five in a hundred, +- 3 sd and what twenty runs do not know of a variance. Without the errors
  // of the prediction: more than half.
  EXPECT_GT(below, 0.02 * kTimes);
  EXPECT_LT(below, 0.10 * kTimes);
  EXPECT_LT(segments_below, 0.10 * kTimes);
}

TEST(WeightedStatistics, QuantilesAndHistogram) {
  const std::vector<double> values = {1, 2, 3, std::nan("")};
  const std::vector<double> weights = {1, 1, 2, 5};
  EXPECT_DOUBLE_EQ(WeightedMean(values, weights), 2.25);
  EXPECT_DOUBLE_EQ(WeightedQuantile(values, weights, 0.5), 2);
  EXPECT_DOUBLE_EQ(WeightedQuantile(values, weights, 0.95), 3);
  const auto density = WeightedHistogram(values, weights, 0, 4, 4);
  EXPECT_DOUBLE_EQ(density[3], 0.5);
  EXPECT_TRUE(std::isnan(WeightedMean({}, {})));
}

}  // namespace
}  // namespace calib::report
