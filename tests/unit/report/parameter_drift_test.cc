#include "server/report/views/parameter_drift.h"

#include <gtest/gtest.h>

#include <cmath>

#include "inference/sampling/philox.h"
#include "server/report/views/run_table.h"

namespace calib::report {
namespace {

// Two tests at different pressures; strength = friction x shape, volume = -friction x strain. The
// measurement of the second one was made with `other` as friction.
CampaignView TwoPressures(double other) {
  constexpr int kDriftReadings = 24;
  constexpr int kRuns = 40;
  constexpr double kTruth = 0.5;
  inference::PhiloxStream random({.seed = 11,
                                  .purpose = inference::StreamPurpose::kDiagnosisNull,
                                  .iteration = 0,
                                  .sample = 0});
  const auto strength = [](double friction, double stiffness, double strain) {
    return 2 * friction * (1 - std::exp(-strain * 100 * stiffness));
  };
  CampaignView view;
  view.campaign.parameters = {
      {"friction", "1", {.kind = inference::PriorKind::kUniform, .min = 0.1, .max = 1}},
      {"stiffness", "1", {.kind = inference::PriorKind::kLogUniform, .min = 0.3, .max = 3}}};
  for (const double pressure : {1e5, 1e6}) {
    campaign::Experiment e;
    e.name = pressure < 5e5 ? "low" : "high";
    e.settings = {{"confining_pressure", pressure}};
    e.control_name = "axial_strain";
    campaign::MeasuredObservable o{.name = "q_over_p", .values = {}, .sd = {}};
    for (int i = 0; i < kDriftReadings; ++i) {
      const double strain = 0.1 * (i + 1) / kDriftReadings;
      e.control.push_back(strain);
      e.path.push_back({.target = strain, .load_step = i});
      e.segment.emplace_back(i < kDriftReadings / 2 ? "initial_loading" : "steady_state");
      o.sd.push_back(0.02);
      o.values.push_back(strength(pressure < 5e5 ? kTruth : other, 1, strain) +
                         0.02 * random.Normal());
    }
    e.observables = {o};
    view.campaign.experiments.push_back(std::move(e));
  }
  for (int s = 0; s < kRuns; ++s) {
    v1::Sample sample;
    sample.set_index(s);
    const double friction = 0.1 + 0.9 * random.Uniform();
    const double stiffness = 0.3 * std::pow(10, random.Uniform());
    sample.add_parameters(friction);
    sample.add_parameters(stiffness);
    for (const campaign::Experiment& e : view.campaign.experiments) {
      StateHistory& history = view.states[{e.name, s}];
      history.observables = {"q_over_p"};
      for (int i = 0; i < kDriftReadings; ++i) {
        v1::State state;
        state.set_load_step(i);
        state.add_values(strength(friction, stiffness, e.control[static_cast<std::size_t>(i)]));
        history.states.push_back(std::move(state));
      }
    }
    view.samples.push_back(std::move(sample));
  }
  return view;
}

TEST(ParameterDrift, OneFrictionForBothPressuresIsNoDrift) {
  const auto drifts = ParameterDrifts(TwoPressures(0.5));
  ASSERT_TRUE(drifts.ok()) << drifts.status();
  ASSERT_EQ(drifts->size(), 2U);
  const ParameterDrift& friction = drifts->front();
  ASSERT_TRUE(friction.p_experiments.has_value());
  EXPECT_GT(*friction.p_experiments, 0.01);
  EXPECT_TRUE(friction.trend_with.empty());
  EXPECT_NEAR(friction.fits.front().mean, 0.5, 0.02);
}

TEST(ParameterDrift, FrictionThatFallsWithPressureIsSeenWithItsTrend) {
  const auto drifts = ParameterDrifts(TwoPressures(0.4));
  ASSERT_TRUE(drifts.ok()) << drifts.status();
  const ParameterDrift& friction = drifts->front();
  EXPECT_LT(*friction.p_experiments, 1e-4);
  EXPECT_EQ(friction.trend_with, "confining_pressure");
  EXPECT_NEAR(friction.trend, -0.1, 0.02);  // per factor ten
  const ParameterDrift& stiffness = drifts->back();
  EXPECT_GT(*stiffness.p_experiments, 1e-3);
}

// Packings whose strength differs by a tenth: what 0.4 at the higher pressure may well be.
TEST(ParameterDrift, ScatterOfPackingsIsNoDrift) {
  CampaignView view = TwoPressures(0.4);
  inference::PhiloxStream random({.seed = 5,
                                  .purpose = inference::StreamPurpose::kDiagnosisNull,
                                  .iteration = 1,
                                  .sample = 0});
  constexpr double kScatter = 0.1;
  constexpr int kPackings = 8;
  for (campaign::Experiment& e : view.campaign.experiments) {
    e.specimens.resize(kPackings);
    v1::Posterior::Scatter& scatter = *view.posterior.add_scatter();
    scatter.set_experiment(e.name);
    scatter.set_observable("q_over_p");
    for (const double value : e.observables[0].values) {
      scatter.add_sd(kScatter * value);
      scatter.add_clock(0.01 * scatter.sd_size());
    }
    scatter.set_share(1);
    scatter.set_runs(kPackings);
    scatter.set_from("realizations");
  }
  for (int r = 0; r < kPackings; ++r) {
    v1::Sample replicate = view.samples.front();
    replicate.set_index(1000 + r);
    replicate.set_purpose("replicate");
    for (const campaign::Experiment& e : view.campaign.experiments) {
      StateHistory history = view.states[{e.name, 0}];
      const double factor = 1 + kScatter * random.Normal();
      for (v1::State& state : history.states) {
        state.set_values(0, factor * state.values(0));
      }
      view.states[{e.name, replicate.index()}] = history;
    }
    view.samples.push_back(replicate);
  }
  const ScatteredReadings readings = ReadingsWithScatter(view);
  ASSERT_TRUE(readings.measured);
  EXPECT_EQ(readings.departures.rows(), kPackings);
  const auto drifts = ParameterDrifts(view);
  ASSERT_TRUE(drifts.ok()) << drifts.status();
  const ParameterDrift& friction = drifts->front();
  ASSERT_TRUE(friction.p_experiments.has_value());
  EXPECT_GT(*friction.p_experiments, 0.01);
  EXPECT_TRUE(friction.trend_with.empty());
  EXPECT_GT(friction.fits.front().sd, 0.03) << "a tenth of 0.5, twice its square and a little";
}

TEST(ParameterDrift, NeedsAKnownSizeOfTheErrorsAndRuns) {
  CampaignView view = TwoPressures(0.5);
  view.campaign.filter.noise = inference::NoiseMode::kInferred;
  EXPECT_TRUE(absl::IsFailedPrecondition(ParameterDrifts(view).status()));
  view = TwoPressures(0.5);
  view.samples.resize(3);
  EXPECT_TRUE(absl::IsFailedPrecondition(ParameterDrifts(view).status()));
}

}  // namespace
}  // namespace calib::report
