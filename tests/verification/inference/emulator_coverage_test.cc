// Intervals of the emulated posterior hold the truth as often as they say, where those of the
// weighted runs do not.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <boost/math/distributions/binomial.hpp>
#include <cmath>
#include <cstdlib>
#include <iostream>

#include "inference/emulator/emulated_posterior.h"
#include "inference/sampling/sobol.h"
#include "tests/verification/inference/hyperbolic_curve.h"
#include "tests/verification/inference/toy_curve.h"

namespace calib::inference {
namespace {

struct Coverage {
  int intervals = 0;
  int emulated = 0;  // that hold the truth
  int weighted = 0;
  int adequate = 0;
};

// Campaigns of one iteration: truth from the prior, one run there measured with 1 % noise, `runs`
// runs of a design.
template <typename Curve = ToyCurve>
Coverage Repeat(const Curve& toy, int runs, std::uint64_t campaigns,
                const TrainingOptions& training = {}, std::uint64_t first = 0) {
  Coverage coverage;
  const auto priors = toy.Priors();
  for (std::uint64_t r = first; r < first + campaigns; ++r) {
    PhiloxStream stream(
        {.seed = 400 + r, .purpose = StreamPurpose::kTest, .iteration = 3, .sample = 0});
    Eigen::VectorXd truth(toy.d);
    for (int j = 0; j < toy.d; ++j)
      truth[j] = priors[static_cast<std::size_t>(j)].Quantile(stream.Uniform());
    const DataSet data = toy.Measure(truth, 0.01, 400 + r);
    Iteration iteration;
    iteration.parameters = ScrambledSobol(runs, toy.d, r);
    for (int j = 0; j < toy.d; ++j) {
      for (double& value : iteration.parameters.col(j))
        value = priors[static_cast<std::size_t>(j)].Quantile(value);
    }
    iteration.predictions.resize(runs, toy.readings);
    for (int i = 0; i < runs; ++i) {
      iteration.predictions.row(i) =
          toy.Run(iteration.parameters.row(i), r, static_cast<std::uint64_t>(i));
    }
    const auto emulated = EmulatedPosterior(
        priors, data, {.training = training, .draws = 1000, .seed = r}, {&iteration, 1});
    const auto weighted = ComputePosterior(priors, data, {}, {&iteration, 1});
    EXPECT_TRUE(emulated.ok() && weighted.ok());
    if (!emulated.ok() || !weighted.ok()) return coverage;
    coverage.adequate += emulated->adequate ? 1 : 0;
    for (int j = 0; j < toy.d; ++j) {
      const auto holds = [value = truth[j]](const ParameterSummary& p) {
        return p.q05 <= value && value <= p.q95 ? 1 : 0;
      };
      ++coverage.intervals;
      coverage.emulated += holds(emulated->parameters[static_cast<std::size_t>(j)]);
      coverage.weighted += holds(weighted->parameters[static_cast<std::size_t>(j)]);
    }
  }
  return coverage;
}

TEST(EmulatorCoverage, NinetyPercentIntervalsHoldTheTruthNineTimesInTen) {
  Coverage all;
  struct Campaign {
    int parameters, runs;
    std::uint64_t repeats;
  };
  for (const Campaign& campaign :
       {Campaign{2, 60, 30}, Campaign{3, 60, 25}, Campaign{5, 100, 12}}) {
    const Coverage one = Repeat({.d = campaign.parameters}, campaign.runs, campaign.repeats);
    std::cout << campaign.parameters << " parameters, " << campaign.runs
              << " runs: " << one.emulated << " of " << one.intervals
              << " intervals hold the truth, " << one.weighted << " of the weighted ensemble\n";
    EXPECT_EQ(one.adequate, static_cast<int>(campaign.repeats));
    all.intervals += one.intervals;
    all.emulated += one.emulated;
    all.weighted += one.weighted;
  }
  // 195 intervals: binomial sd 2 %, and the seeds are fixed.
  EXPECT_GE(all.emulated, 0.85 * all.intervals);
  EXPECT_LE(all.emulated, 0.95 * all.intervals);
  EXPECT_LE(all.weighted, 0.6 * all.intervals);
}

// Triaxial curves in closed form, campaigns of 100 runs, 1 % noise; CALIB_COVERAGE sets the number
// of campaigns. Intervals of one campaign are related, so that the standard error of the share is
// taken from the campaigns' own shares.
TEST(EmulatorCoverageSlow, HundredRunsOfATriaxialTestWithOnePercentNoise) {
  const char* text = std::getenv("CALIB_COVERAGE");
  const int campaigns = text != nullptr ? std::max(2, std::atoi(text)) : 40;
  Coverage all;
  double squares = 0;
  for (int r = 0; r < campaigns; ++r) {
    const Coverage one =
        Repeat(HyperbolicCurve{}, 100, 1, {}, 1000 + static_cast<std::uint64_t>(r));
    all.intervals += one.intervals;
    all.emulated += one.emulated;
    all.weighted += one.weighted;
    all.adequate += one.adequate;
    squares += one.emulated * one.emulated;
  }
  const double share = static_cast<double>(all.emulated) / all.intervals;
  const double mean = static_cast<double>(all.emulated) / campaigns;
  const double error =
      std::sqrt((squares / campaigns - mean * mean) / (campaigns - 1)) * campaigns / all.intervals;
  std::cout << all.emulated << " of " << all.intervals << " intervals hold the truth: " << share
            << " +- " << error << "; " << all.weighted << " of the weighted ensemble\n";
  EXPECT_EQ(all.adequate, campaigns);
  EXPECT_GE(share, 0.85);
  EXPECT_LE(share, 0.95);
  // Fewer than a coverage of 85 % would leave once in ten thousand times.
  const boost::math::binomial_distribution<double> wanted(all.intervals, 0.85);
  EXPECT_LT(all.weighted, boost::math::quantile(wanted, 1e-4));
}

// The limits of EmulatorOptions: a rough response that the measurement is not taken to share makes
// intervals that miss the truth, and is refused; the same with roughness well below the noise is
// accepted and honest.
TEST(EmulatorCoverage, RefusesWhereIntervalsAreFiction) {
  constexpr std::uint64_t kRepeats = 12;
  const Coverage rough = Repeat({.d = 3, .roughness = 0.05}, 60, kRepeats, {.scatter_share = 0});
  const Coverage smooth =
      Repeat({.d = 3, .scatter = 0.002, .roughness = 0.002}, 60, kRepeats, {.scatter_share = 0});
  std::cout << "rough: " << rough.emulated << " of " << rough.intervals << ", adequate "
            << rough.adequate << "; smooth: " << smooth.emulated << " of " << smooth.intervals
            << ", adequate " << smooth.adequate << '\n';
  EXPECT_EQ(rough.adequate, 0);
  EXPECT_LT(rough.emulated, 0.75 * rough.intervals);
  EXPECT_EQ(smooth.adequate, static_cast<int>(kRepeats));
  EXPECT_GE(smooth.emulated, 0.8 * smooth.intervals);  // of 36: binomial sd 5 %
}

}  // namespace
}  // namespace calib::inference
