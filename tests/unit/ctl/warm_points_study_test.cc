// How fast refits close in on a model whose right parameters are known, and on readings that none of its
// parameters reach. CALIB_SEEDS sets how many of each (12: two minutes).

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <vector>

#include "inference/sampling/philox.h"
#include "server/ctl/warm_points.h"

namespace calib::ctl {
namespace {

using Eigen::Index;

constexpr int kReadings = 25;  // of each observable and pressure
constexpr double kEnd = 0.2;   // axial strain
constexpr int kBatches = 8;
constexpr int kBatch = 6;
constexpr double kPressures[] = {0.2, 1.0};  // MPa

struct Point {
  double modulus = 1;    // GPa
  double friction = 30;  // deg
  double stiffness = 0;  // of rolling, a ratio
  double limit = 0;      // of rolling
};

Point AsPoint(const Eigen::RowVectorXd& row) {
  return {.modulus = row[0], .friction = row[1], .stiffness = row[2], .limit = row[3]};
}

// Stress ratio and volumetric strain of a dense sand, made up: rolling resistance strengthens it as
// friction does, and saturates; the peak comes later and lower where grains are soft. Each run has scatter
// of 1 % and 4e-4, correlated along the path.
Eigen::VectorXd History(const Point& point, inference::PhiloxStream& random) {
  const double mu = std::tan(point.friction * std::numbers::pi / 180);
  const double rolling = point.limit * (1 - std::exp(-8 * point.stiffness / (0.05 + point.limit)));
  Eigen::VectorXd history(2 * 2 * kReadings);
  Index at = 0;
  for (const double pressure : kPressures) {
    const double critical =
        1 + 1.2 * mu / (mu + 0.35) + 1.6 * rolling * mu / (mu + 0.3) / (0.25 + rolling);
    const double peak =
        critical + std::pow(pressure / 0.2, -0.12) *
                       (0.5 * mu / (mu + 0.3) + 1.9 * rolling / (0.3 + rolling) * mu / (0.2 + mu));
    const double stiff = 0.3 + 40 * std::pow(point.modulus / (10 * pressure), 0.55) *
                                   (0.4 + mu / (0.4 + mu) + 0.5 * rolling);
    const double strain_at_peak = 0.03 + 0.36 * (peak - 1) / stiff;
    double volume = 0;
    double of_ratio = 0;
    double of_volume = 0;
    for (int i = 1; i <= kReadings; ++i) {
      const double strain = kEnd * i / kReadings;
      const double past = std::max(0.0, strain - strain_at_peak);
      const double ratio = 1 + (peak - 1) * (1 - std::exp(-stiff * strain / (peak - 1))) -
                           (peak - critical) * (1 - std::exp(-past / 0.06));
      const double dilation =
          0.5 * (peak - critical) * std::exp(-past / 0.07) * (1 - std::exp(-100 * strain));
      volume += (0.3 * std::exp(-stiff * strain / 4) - dilation) * kEnd / kReadings;
      of_ratio = 0.7 * of_ratio + 0.7 * random.Normal();
      of_volume = 0.9 * of_volume + 0.4 * random.Normal();
      history[at++] = std::max(1.0, ratio) * (1 + 0.01 * of_ratio);
      history[at++] = volume + 4e-4 * of_volume;
    }
  }
  return history;
}

// Errors: 2 % and 1e-3.
campaign::Campaign Extended(const Eigen::VectorXd& measured, std::uint64_t seed) {
  campaign::Campaign campaign;
  for (int test = 0; test < 2; ++test) {
    campaign::Experiment experiment;
    experiment.name = test == 0 ? "low" : "high";
    experiment.test = "triaxial_drained";
    experiment.control_name = "axial_strain";
    campaign::MeasuredObservable ratio{.name = "stress_ratio", .values = {}, .sd = {}};
    campaign::MeasuredObservable volume{.name = "volumetric_strain", .values = {}, .sd = {}};
    for (int i = 0; i < kReadings; ++i) {
      const double strain = kEnd * (i + 1) / kReadings;
      experiment.control.push_back(strain);
      experiment.path.push_back({.target = strain, .load_step = i});
      experiment.segment.emplace_back("initial_loading");
      const Index at = 2 * static_cast<Index>(test * kReadings + i);
      ratio.values.push_back(measured[at]);
      ratio.sd.push_back(0.02 * measured[at]);
      volume.values.push_back(measured[at + 1]);
      volume.sd.push_back(1e-3);
    }
    experiment.observables = {ratio, volume};
    campaign.experiments.push_back(experiment);
  }
  const auto add = [&campaign](const char* name, inference::PriorKind kind, double min,
                               double max) {
    campaign.parameters.push_back(
        {.name = name, .unit = "1", .prior = {.kind = kind, .min = min, .max = max}});
  };
  add("modulus", inference::PriorKind::kLogUniform, 0.5, 100);
  add("friction", inference::PriorKind::kUniform, 10, 60);
  add("stiffness", inference::PriorKind::kLogUniform, 0.01, 10);
  add("limit", inference::PriorKind::kUniform, 0, 1);
  campaign.filter.seed = seed;
  return campaign;
}

// Smallest rms error after each batch, sd: 90 runs of the model without rolling that have closed in on the
// best it can, four of a screen, then batches of six, the first of them half prior, half about that best.
std::vector<double> Closest(std::uint64_t seed, double out_of_reach) {
  inference::PhiloxStream random({.seed = seed});
  const auto between = [&random](double a, double b) { return a + (b - a) * random.Uniform(); };
  const auto over_decades = [&between](double a, double b) {
    return std::exp(between(std::log(a), std::log(b)));
  };
  const Point truth{.modulus = over_decades(1, 8),
                    .friction = between(24, 34),
                    .stiffness = over_decades(0.1, 1),
                    .limit = between(0.2, 0.5)};
  Eigen::VectorXd measured = History(truth, random);
  for (Index k = 0; k < measured.size(); k += 2) {  // a wave that is none of the model's
    const double along = static_cast<double>(k / 2 % kReadings + 1) / kReadings;
    const bool high = k / 2 >= kReadings;
    measured[k] *=
        1 + out_of_reach * 0.02 * std::numbers::sqrt2 * std::sin(5 * along + (high ? 1 : 0));
    measured[k + 1] +=
        out_of_reach * 1e-3 * std::numbers::sqrt2 * std::sin(4 * along + (high ? -1 : 1));
  }
  const campaign::Campaign campaign = Extended(measured, seed);
  const report::ScatteredReadings readings{.of_mean = campaign::MakeDataSet(campaign),
                                           .of_run = campaign::MakeDataSet(campaign),
                                           .measured = false};
  report::RunTable runs;
  const auto run = [&](const Eigen::RowVectorXd& point, const Point& as) {
    report::RunTable one{.sample = {0}, .stream = {0}, .parameters = point, .histories = {}};
    one.histories = History(as, random).transpose();
    for (Index k = 0; k < one.histories.cols(); ++k) {
      const inference::Reading& reading = readings.of_mean.readings[static_cast<std::size_t>(k)];
      one.histories(0, k) = (one.histories(0, k) - reading.value) / reading.sd;
    }
    Append(one, runs);
  };
  const auto closest = [&runs] {
    Index best = 0;
    const double chi2 = runs.histories.rowwise().squaredNorm().minCoeff(&best);
    return std::pair(best, std::sqrt(chi2 / static_cast<double>(runs.histories.cols())));
  };
  const auto near = [&](double spread) {  // of what has come closest
    const Eigen::RowVectorXd best = runs.parameters.row(closest().first);
    return std::pair(std::clamp(best[0] * std::exp(spread * random.Normal()), 0.5, 100.0),
                     std::clamp(best[1] + 15 * spread * random.Normal(), 10.0, 60.0));
  };
  Eigen::RowVectorXd point(4);
  for (int i = 0; i < 90; ++i) {
    const auto [modulus, friction] =
        i < 30 ? std::pair(over_decades(0.5, 100), between(10, 60)) : near(0.3);
    const bool no_limit = i % 2 == 0;  // at either null
    point << modulus, friction, no_limit ? over_decades(0.01, 10) : 0.01,
        no_limit ? 0 : between(0, 1);
    run(point, {.modulus = modulus, .friction = friction});
  }
  const auto [best, without] = closest();
  const Eigen::RowVectorXd base = runs.parameters.row(best);
  for (const int strong : {0, 0, 1, 1}) {
    point << base[0], base[1], strong == 0 ? 0.1 : 0.4, strong == 0 ? 0.05 : 0.15;
    run(point, AsPoint(point));
  }
  std::vector<double> rms;
  for (int batch = 0; batch < kBatches; ++batch) {
    Eigen::MatrixXd points(kBatch, 4);
    if (batch > 0) {
      const auto next = NextPoints(campaign, readings, runs, batch, kBatch);
      EXPECT_TRUE(next.ok()) << next.status();
      if (!next.ok()) return rms;
      points = *next;
    }
    for (int i = 0; i < kBatch; ++i) {
      if (batch == 0) {
        const auto [modulus, friction] =
            i % 2 == 0 ? near(0.6) : std::pair(over_decades(0.5, 100), between(10, 60));
        points.row(i) << modulus, friction, over_decades(0.01, 10), between(0, 1);
      }
      run(points.row(i), AsPoint(points.row(i)));
    }
    rms.push_back(closest().second);
  }
  std::printf("  seed %d: %.2f without;", static_cast<int>(seed), without);
  for (const double value : rms) std::printf(" %.2f", value);
  std::printf("\n");
  return rms;
}

TEST(WarmPointsStudy, CloseInOnReadingsInAndOutOfReach) {
  const char* text = std::getenv("CALIB_SEEDS");
  const int seeds = text != nullptr ? std::max(1, std::atoi(text)) : 1;
  for (const double out_of_reach : {0.0, 4.0}) {
    std::printf("readings %g sd out of reach, smallest rms error after each batch:\n",
                out_of_reach);
    std::vector<double> mean(kBatches, 0);
    for (int seed = 1; seed <= seeds; ++seed) {
      const std::vector<double> rms = Closest(static_cast<std::uint64_t>(seed), out_of_reach);
      ASSERT_EQ(rms.size(), mean.size());
      for (int b = 0; b < kBatches; ++b) mean[b] += std::log(rms[b]) / seeds;
    }
    std::printf("  geometric mean:");
    for (const double value : mean) std::printf(" %.2f", std::exp(value));
    std::printf("\n");
    EXPECT_LT(std::exp(mean.back()), out_of_reach + 1);
  }
}

}  // namespace
}  // namespace calib::ctl
