// Cost of the inference between two iterations: filter update, mixture fit, next proposal. Four
// parameters and 300 readings, as the glass-bead example has; 100 samples are usual, 2000 the
// production set of Cheng 2018.

#include <benchmark/benchmark.h>

#include <cmath>

#include "inference/data/gaussian_likelihood.h"
#include "inference/filter/iterative_filter.h"
#include "inference/filter/sequential_filter.h"
#include "inference/mixture/dirichlet_mixture.h"

namespace calib::inference {
namespace {

constexpr int kParameters = 4;
constexpr int kReadings = 300;

struct Setting {
  std::vector<Prior> priors;
  DataSet data;
  FilterOptions options{.seed = 1};
  std::vector<Iteration> iterations;

  explicit Setting(int n, bool correlated = false) {
    for (int j = 0; j < kParameters; ++j) {
      priors.push_back(
          {.kind = j == 0 ? PriorKind::kLogUniform : PriorKind::kUniform, .min = 1, .max = 10});
    }
    for (int t = 0; t < kReadings; ++t) {
      data.readings.push_back({.observable = t % 3,
                               .load_step = t / 3,
                               .control = 0.01 * (t / 3),
                               .value = Model(Eigen::RowVector4d(3, 4, 5, 6), t),
                               .sd = 2});
    }
    if (correlated)
      data.correlations = {{.observable = 0, .length = 0.1}, {.observable = 1, .length = 0.1}};
    Iteration iteration;
    iteration.parameters = DrawSamples({}, priors, options, 0, n).value();
    iteration.predictions.resize(n, kReadings);
    for (int i = 0; i < n; ++i) {
      for (int t = 0; t < kReadings; ++t)
        iteration.predictions(i, t) = Model(iteration.parameters.row(i), t);
    }
    iterations.push_back(std::move(iteration));
  }

  static double Model(const Eigen::RowVector4d& p, int t) {
    const double x = 0.01 * (t / 3);
    return p[t % 3] * std::tanh(p[3] * x) + p[(t + 1) % 3] * x * x;
  }
};

// Weights after a new load step of the running iteration.
void BM_OnlineView(benchmark::State& state) {
  const Setting setting(static_cast<int>(state.range(0)));
  const std::vector<char> diverged(state.range(0), 0);
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        ViewOnline(setting.data, setting.options, setting.iterations[0].predictions, diverged));
  }
}
BENCHMARK(BM_OnlineView)->Arg(100)->Arg(2000)->Unit(benchmark::kMillisecond);

// Likelihood, weights and moments along all readings.
void BM_Posterior(benchmark::State& state) {
  const Setting setting(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        ComputePosterior(setting.priors, setting.data, setting.options, setting.iterations)->ess);
  }
}
BENCHMARK(BM_Posterior)->Arg(100)->Arg(2000)->Unit(benchmark::kMillisecond);

void BM_PosteriorCorrelated(benchmark::State& state) {
  const Setting setting(static_cast<int>(state.range(0)), true);
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        ComputePosterior(setting.priors, setting.data, setting.options, setting.iterations)->ess);
  }
}
BENCHMARK(BM_PosteriorCorrelated)->Arg(100)->Arg(2000)->Unit(benchmark::kMillisecond);

// One fit of ten starts to samples of equal weight from two Gaussians.
void BM_MixtureFit(benchmark::State& state) {
  PhiloxStream stream({.seed = 3});
  WeightedPoints data{.points = Eigen::MatrixXd(kParameters, state.range(0)),
                      .counts = Eigen::VectorXd::Ones(state.range(0))};
  for (Eigen::Index i = 0; i < data.points.cols(); ++i) {
    for (double& x : data.points.col(i)) x = stream.Normal() + (i % 3 == 0 ? 3 : 0);
  }
  for (auto _ : state)
    benchmark::DoNotOptimize(FitDirichletMixture(data, {.seed = 1})->lower_bound);
}
BENCHMARK(BM_MixtureFit)->Arg(100)->Arg(2000)->Unit(benchmark::kMillisecond);

// From finished runs to the next proposal: tempering, mixture, its mass inside the prior.
void BM_FitProposal(benchmark::State& state) {
  const Setting setting(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        FitProposal(setting.priors, setting.data, setting.options, setting.iterations)
            ->log_acceptance);
  }
}
BENCHMARK(BM_FitProposal)->Arg(100)->Arg(2000)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace calib::inference

BENCHMARK_MAIN();
