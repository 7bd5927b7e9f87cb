#include "server/report/views/curves.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "server/report/views/posterior_shape.h"
#include "tests/unit/report/example_view.h"

namespace calib::report {
namespace {

TEST(Curves, ResidualsAreOfTheMeanInSdOfNoiseAndScatter) {
  const CampaignView view = testing::ExampleView("x");
  const auto all = Curves(view, PredictReadings(view));
  ASSERT_EQ(all.size(), view.campaign.experiments.size());
  int compared = 0;
  for (std::size_t e = 0; e < all.size(); ++e) {
    EXPECT_EQ(all[e].control_values, view.campaign.experiments[e].control);
    for (const ObservableCurves& o : all[e].observables) {
      for (std::size_t i = 0; i < o.values.size(); ++i) {
        if (!std::isfinite(o.residual[i])) continue;
        ++compared;
        EXPECT_NEAR(o.residual[i], (o.prediction.mean[i] - o.values[i]) / o.total_sd[i], 1e-12);
        EXPECT_GE(o.total_sd[i], o.sd[i] * (1 - 1e-12));
      }
    }
  }
  EXPECT_GT(compared, 0);
}

TEST(Curves, BandsLieInOneAnother) {
  const CampaignView view = testing::ExampleView("x");
  int known = 0;
  for (const ExperimentPrediction& experiment : PredictReadings(view)) {
    for (const ObservablePrediction& o : experiment.observables) {
      for (std::size_t i = 0; i < o.mean.size(); ++i) {
        const double ends[] = {o.bands[0][i], o.q05[i], o.bands[1][i], o.bands[2][i],
                               o.bands[3][i], o.q95[i], o.bands[4][i]};
        if (!std::isfinite(ends[0])) continue;
        ++known;
        EXPECT_TRUE(std::is_sorted(std::begin(ends), std::end(ends)));
      }
    }
  }
  EXPECT_GT(known, 0);
}

v1::Sample Make(int index, const std::string& status, double log_likelihood) {
  v1::Sample sample;
  sample.set_index(index);
  sample.set_status(status);
  sample.set_log_likelihood(log_likelihood);
  return sample;
}

TEST(Curves, DrawTheMostLikelyRunsAndTheLastOfTheOthers) {
  std::vector<v1::Sample> samples;
  for (int k = 0; k < 30; ++k) samples.push_back(Make(k, "finished", -std::abs(k - 17)));
  for (int k = 30; k < 60; ++k) samples.push_back(Make(k, "stopped_early", std::nan("")));
  samples.push_back(Make(60, "waiting", std::nan("")));
  samples.push_back(Make(61, "diverged", std::nan("")));
  samples.push_back(Make(62, "running", std::nan("")));
  const std::vector<DrawnRun> runs = RunsToDraw(samples);
  ASSERT_EQ(runs.size(), 20U);
  EXPECT_EQ(runs[0].sample, 17);
  EXPECT_EQ(runs[0].rank, 1);
  EXPECT_EQ(runs[9].rank, 10);
  EXPECT_EQ(runs[10].rank, std::nullopt);
  EXPECT_EQ(runs[10].sample, 51);
  EXPECT_EQ(runs[19].sample, 62);
}

TEST(Curves, BeforeThereIsAPosteriorAreOfReadingsAndRunsAlone) {
  CampaignView view = testing::ExampleView("x");
  view.posterior.Clear();
  const auto all = Curves(view, {});
  ASSERT_FALSE(all.empty());
  const ObservableCurves& o = all[0].observables.at(0);
  EXPECT_EQ(o.values, view.campaign.experiments[0].observables[0].values);
  EXPECT_TRUE(std::isnan(o.prediction.mean[0]));
  EXPECT_TRUE(std::isnan(o.residual[0]));
  EXPECT_EQ(o.runs.size(), all[0].runs.size());
}

double Integral(const DensityCurve& curve) {
  double sum = 0;
  for (std::size_t k = 1; k < curve.size(); ++k) {
    sum += (curve[k].first - curve[k - 1].first) * (curve[k].second + curve[k - 1].second) / 2;
  }
  return sum;
}

/// A posterior by weights on one parameter, normal of mean 3 and sd 0.1 by its weights.
struct OneParameter {
  explicit OneParameter(const inference::Prior& prior) {
    parameters = {{.name = "a", .unit = "1", .prior = prior}};
    posterior.set_posterior_from("weights");
    auto& p = *posterior.add_parameters();
    p.set_name("a");
    p.set_prior_min(prior.min);
    p.set_prior_max(prior.max);
    constexpr int kSamples = 2000;
    double sum = 0;
    for (int k = 0; k < kSamples; ++k) {
      v1::Sample& sample = samples.emplace_back();
      const double x = 1 + 4.0 * (k + 0.5) / kSamples;
      sample.add_parameters(x);
      sample.set_weight(std::exp(-(x - 3) * (x - 3) / 0.02));
      sum += sample.weight();
    }
    for (v1::Sample& sample : samples) sample.set_weight(sample.weight() / sum);
  }
  v1::Posterior posterior;
  std::vector<campaign::CalibratedParameter> parameters;
  std::vector<v1::Sample> samples;
};

TEST(PosteriorShape, DensitiesIntegrateToOneWhateverThePrior) {
  for (const auto kind : {inference::PriorKind::kUniform, inference::PriorKind::kLogUniform}) {
    const OneParameter one({.kind = kind, .min = 1, .max = 5});
    const PosteriorShape shape = ShapeOf(one.posterior, one.parameters, one.samples);
    ASSERT_EQ(shape.prior.size(), 1U);
    EXPECT_NEAR(Integral(shape.prior[0]), 1, 1e-3);
    EXPECT_NEAR(Integral(shape.density[0]), 1, 0.01);
    const auto highest =
        std::max_element(shape.density[0].begin(), shape.density[0].end(),
                         [](const auto& a, const auto& b) { return a.second < b.second; });
    EXPECT_NEAR(highest->first, 3, 0.05);
    // 1 / (0.1 sqrt(2 pi)), lower by the width of the kernels: a factor 1 / sqrt(1 + h^2), h < 0.3.
    EXPECT_NEAR(highest->second, 3.99, 0.25);
  }
}

TEST(PosteriorShape, DrawsAreOfTheWeights) {
  const OneParameter one({.min = 1, .max = 5});
  const PosteriorShape shape = ShapeOf(one.posterior, one.parameters, one.samples);
  ASSERT_EQ(shape.draws.size(), 500U);
  double mean = 0;
  double square = 0;
  for (const auto& draw : shape.draws) {
    mean += draw[0] / 500;
    square += draw[0] * draw[0] / 500;
  }
  EXPECT_NEAR(mean, 3, 0.003);  // the sum of 500 strata
  EXPECT_NEAR(std::sqrt(square - mean * mean), 0.1, 0.003);
}

TEST(PosteriorShape, WithoutAPosteriorThereIsThePriorAlone) {
  OneParameter one({.min = 1, .max = 5});
  one.posterior.set_posterior_from("none");
  const PosteriorShape shape = ShapeOf(one.posterior, one.parameters, one.samples);
  EXPECT_TRUE(shape.draws.empty());
  EXPECT_TRUE(shape.density[0].empty());
  EXPECT_EQ(shape.prior[0].size(), 101U);
  EXPECT_TRUE(ShapeOf({}, {}, {}).draws.empty());
}

}  // namespace
}  // namespace calib::report
