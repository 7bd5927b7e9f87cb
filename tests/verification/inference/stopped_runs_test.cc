// Runs that were stopped early teach the emulator what they came to: without them it takes the
// model to lie nearer to the readings than it does.
#include "inference/emulator/stopped_runs.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <utility>
#include <vector>

#include "inference/filter/iterative_filter.h"
#include "inference/sampling/sobol.h"
#include "tests/verification/inference/toy_curve.h"

namespace calib::inference {
namespace {

constexpr int kAllRuns = 80;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

// A campaign whose runs scatter by twice the noise, so that scatter decides which are stopped.
struct StoppedCampaign {
  std::vector<Prior> priors;
  DataSet data;
  Iteration full;     // every run at its end
  Iteration stopped;  // runs stopped where their misfit passes that of half of the runs
  int count = 0;      // of stopped runs
};

StoppedCampaign Make(std::uint64_t seed) {
  const ToyCurve toy{.d = 2, .scatter = 0.02};
  PhiloxStream stream(
      {.seed = 400 + seed, .purpose = StreamPurpose::kTest, .iteration = 3, .sample = 0});
  Eigen::VectorXd truth(toy.d);
  StoppedCampaign campaign;
  for (double& value : truth) {
    value = 0.3 + 0.4 * stream.Uniform();
    campaign.priors.push_back(
        {.kind = PriorKind::kUniform, .min = value - 0.25, .max = value + 0.25});
  }
  ToyCurve mean = toy;
  mean.scatter = 0;
  campaign.data = mean.Measure(truth, 0.01, 400 + seed);
  Iteration& full = campaign.full;
  full.parameters = ScrambledSobol(kAllRuns, toy.d, seed);
  full.predictions.resize(kAllRuns, toy.readings);
  for (int j = 0; j < toy.d; ++j) {
    for (double& value : full.parameters.col(j)) {
      value = campaign.priors[static_cast<std::size_t>(j)].Quantile(value);
    }
  }
  for (int i = 0; i < kAllRuns; ++i) {
    full.predictions.row(i) = toy.Run(full.parameters.row(i), seed, static_cast<std::uint64_t>(i));
  }
  const int steps = toy.readings / 2;  // two observables, one after the other
  const auto misfit = [&](int run, int reading) {
    const Reading& r = campaign.data.readings[static_cast<std::size_t>(reading)];
    return std::pow((full.predictions(run, reading) - r.value) / r.sd, 2);
  };
  std::vector<double> totals(kAllRuns, 0);
  for (int i = 0; i < kAllRuns; ++i) {
    for (int t = 0; t < toy.readings; ++t) totals[static_cast<std::size_t>(i)] += misfit(i, t);
  }
  std::sort(totals.begin(), totals.end());
  campaign.stopped = full;
  campaign.stopped.stopped = Eigen::MatrixXd::Constant(kAllRuns, toy.readings, kNone);
  for (int i = 0; i < kAllRuns; ++i) {
    double so_far = 0;
    for (int t = 0; t + 1 < steps; ++t) {
      so_far += misfit(i, t) + misfit(i, steps + t);
      if (so_far <= totals[kAllRuns / 2]) continue;
      campaign.stopped.predictions.row(i).setConstant(kNone);
      for (const int first : {0, steps}) {
        campaign.stopped.stopped.row(i).segment(first, t + 1) =
            full.predictions.row(i).segment(first, t + 1);
      }
      ++campaign.count;
      break;
    }
  }
  return campaign;
}

// Runs of an iteration as the emulator takes them: the finished ones, or the stopped ones.
Runs RunsOf(const StoppedCampaign& campaign, const Iteration& iteration, bool stopped) {
  std::vector<Eigen::Index> rows;
  for (Eigen::Index i = 0; i < kAllRuns; ++i) {
    if (iteration.predictions.row(i).allFinite() != stopped) rows.push_back(i);
  }
  const JointPrior priors(campaign.priors);
  const Eigen::MatrixXd& histories = stopped ? iteration.stopped : iteration.predictions;
  Runs runs{.inputs = iteration.parameters(rows, Eigen::all),
            .histories = histories(rows, Eigen::all)};
  for (Eigen::Index i = 0; i < runs.inputs.rows(); ++i) {
    runs.inputs.row(i) = priors.ToStandard(runs.inputs.row(i).transpose()).transpose();
    for (Eigen::Index t = 0; t < runs.histories.cols(); ++t) {
      const Reading& reading = campaign.data.readings[static_cast<std::size_t>(t)];
      runs.histories(i, t) = (runs.histories(i, t) - reading.value) / reading.sd;
    }
  }
  return runs;
}

// Over the prior, in sd of the readings: mean square of what an emulator has the model's mean
// history wrong by, and by how much it has its distance from the readings too small.
struct Wrong {
  double square = 0;
  double nearer = 0;

  void Add(const StoppedCampaign& campaign, const Runs& finished, const Runs& stopped,
           std::uint64_t seed) {
    constexpr int kPoints = 64;
    ToyCurve mean{.d = 2};
    mean.scatter = 0;
    const auto trained =
        TrainWithStopped(finished, stopped, campaign.data, {.scatter_share = 0}, {.seed = seed});
    ASSERT_TRUE(trained.ok()) << trained.status();
    const Eigen::MatrixXd unit = ScrambledSobol(kPoints, 2, 1000 + seed);
    const JointPrior priors(campaign.priors);
    const PrincipalComponents& components = trained->emulator.components();
    for (const auto& at : unit.rowwise()) {
      const Eigen::VectorXd x = priors.FromUnit(at);
      const ScorePrediction prediction =
          trained->emulator.Predict(priors.ToStandard(x).transpose());
      const Eigen::RowVectorXd emulated =
          components.mean + prediction.mean * components.basis.transpose();
      Eigen::RowVectorXd exact = mean.Mean(x).transpose();
      for (Eigen::Index t = 0; t < exact.size(); ++t) {
        const Reading& reading = campaign.data.readings[static_cast<std::size_t>(t)];
        exact[t] = (exact[t] - reading.value) / reading.sd;
      }
      const auto readings = static_cast<double>(exact.size());
      square += (emulated - exact).squaredNorm() / readings / kPoints;
      nearer += (exact.norm() - emulated.norm()) / std::sqrt(readings) / kPoints;
    }
  }
};

TEST(StoppedRuns, TeachTheEmulatorWhatTheyCameTo) {
  constexpr int kCampaigns = 8;
  Wrong left_out;
  Wrong completed;
  Wrong all;
  for (std::uint64_t seed = 0; seed < kCampaigns; ++seed) {
    const StoppedCampaign campaign = Make(seed);
    ASSERT_GT(campaign.count, kAllRuns / 5);
    const Runs finished = RunsOf(campaign, campaign.stopped, false);
    const Runs stopped = RunsOf(campaign, campaign.stopped, true);
    left_out.Add(campaign, finished, RunsOf(campaign, campaign.full, true), seed);
    completed.Add(campaign, finished, stopped, seed);
    all.Add(campaign, RunsOf(campaign, campaign.full, false), RunsOf(campaign, campaign.full, true),
            seed);
  }
  for (const auto& [name, wrong] : {std::pair("left out", left_out),
                                    std::pair("completed", completed), std::pair("all", all)}) {
    std::cout << name << ": rms " << std::sqrt(wrong.square / kCampaigns)
              << " sd, nearer to the readings by " << wrong.nearer / kCampaigns << " sd\n";
  }
  EXPECT_GT(left_out.nearer, 0.1 * kCampaigns) << "the case is no longer one";
  EXPECT_LT(std::abs(completed.nearer), left_out.nearer / 2);
  EXPECT_LT(completed.square, left_out.square / 2);
}

}  // namespace
}  // namespace calib::inference
