// Intervals of the emulated posterior hold the truth as often as they say, where those of the
// weighted runs do not.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <iostream>

#include "inference/emulator/emulated_posterior.h"
#include "inference/sampling/sobol.h"
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
Coverage Repeat(const ToyCurve& toy, int runs, std::uint64_t campaigns) {
  Coverage coverage;
  const auto priors = toy.Priors();
  for (std::uint64_t r = 0; r < campaigns; ++r) {
    PhiloxStream stream(
        {.seed = 400 + r, .purpose = StreamPurpose::kTest, .iteration = 3, .sample = 0});
    Eigen::VectorXd truth(toy.d);
    for (double& value : truth) value = stream.Uniform();
    const DataSet data = toy.Measure(truth, 0.01, 400 + r);
    Iteration iteration;
    iteration.parameters = ScrambledSobol(runs, toy.d, r);
    iteration.predictions.resize(runs, toy.readings);
    for (int i = 0; i < runs; ++i) {
      iteration.predictions.row(i) =
          toy.Run(iteration.parameters.row(i), r, static_cast<std::uint64_t>(i));
    }
    const auto emulated =
        EmulatedPosterior(priors, data, {.draws = 1000, .seed = r}, {&iteration, 1});
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
       {Campaign{2, 60, 30}, Campaign{3, 100, 25}, Campaign{5, 100, 15}}) {
    const Coverage one = Repeat({.d = campaign.parameters}, campaign.runs, campaign.repeats);
    std::cout << campaign.parameters << " parameters, " << campaign.runs
              << " runs: " << one.emulated << " of " << one.intervals
              << " intervals hold the truth, " << one.weighted << " of the weighted ensemble\n";
    EXPECT_EQ(one.adequate, static_cast<int>(campaign.repeats));
    all.intervals += one.intervals;
    all.emulated += one.emulated;
    all.weighted += one.weighted;
  }
  // 210 intervals: binomial sd 2 %, and the seeds are fixed.
  EXPECT_GE(all.emulated, 0.85 * all.intervals);
  EXPECT_LE(all.emulated, 0.95 * all.intervals);
  EXPECT_LE(all.weighted, 0.6 * all.intervals);
}

}  // namespace
}  // namespace calib::inference
