// Cost of the inference between two iterations: filter update, mixture fit, next proposal. Four
// parameters and 300 readings, as the glass-bead example has; 100 samples are usual, 2000 the
// production set of Cheng 2018.

#include <benchmark/benchmark.h>

#include <cmath>

#include "inference/data/gaussian_likelihood.h"
#include "inference/filter/iterative_filter.h"
#include "inference/filter/sequential_filter.h"
#include "inference/mixture/dirichlet_mixture.h"
#include "inference/sampling/sobol.h"
#include "inference/surrogate/response_surface.h"

namespace calib::inference {
namespace {

constexpr int kParameters = 4;
constexpr int kReadings = 300;

enum class Errors { kIndependent, kChain, kCovariance };

struct Setting {
  std::vector<Prior> priors;
  DataSet data;
  FilterOptions options{.seed = 1};
  std::vector<Iteration> iterations;

  explicit Setting(int n, Errors errors = Errors::kIndependent) {
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
    for (int observable = 0; observable < 3 && errors != Errors::kIndependent; ++observable)
      data.correlations.push_back({.observable = observable, .length = 0.1});
    if (errors == Errors::kCovariance) GiveCovariances();
    Iteration iteration;
    iteration.parameters = DrawSamples({}, priors, options, 0, n).value();
    iteration.predictions.resize(n, kReadings);
    for (int i = 0; i < n; ++i) {
      for (int t = 0; t < kReadings; ++t)
        iteration.predictions(i, t) = Model(iteration.parameters.row(i), t);
    }
    iterations.push_back(std::move(iteration));
  }

  // The correlated errors once more, in full.
  void GiveCovariances() {
    for (const auto& [group, readings] : GroupsOf(data)) {
      data.covariances.push_back(
          {.observable = group.second, .matrix = 4 * ErrorCorrelation(data, group, readings)});
    }
    data.correlations.clear();
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

// The same where the errors of each of the three observables are correlated along the path.
void BM_PosteriorCorrelated(benchmark::State& state) {
  const Setting setting(static_cast<int>(state.range(0)), Errors::kChain);
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        ComputePosterior(setting.priors, setting.data, setting.options, setting.iterations)->ess);
  }
}
BENCHMARK(BM_PosteriorCorrelated)->Arg(100)->Arg(2000)->Unit(benchmark::kMillisecond);

void BM_PosteriorCovariance(benchmark::State& state) {
  const Setting setting(static_cast<int>(state.range(0)), Errors::kCovariance);
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        ComputePosterior(setting.priors, setting.data, setting.options, setting.iterations)->ess);
  }
}
BENCHMARK(BM_PosteriorCovariance)->Arg(100)->Arg(2000)->Unit(benchmark::kMillisecond);

// One fit of ten starts to samples of equal weight from two Gaussians in 7 dimensions (or 4), ten
// components at most; mixture_bench.py times scikit-learn on the same.
void BM_MixtureFit(benchmark::State& state) {
  PhiloxStream stream({.seed = 3});
  WeightedPoints data{.points = Eigen::MatrixXd(state.range(1), state.range(0)),
                      .counts = Eigen::VectorXd::Ones(state.range(0))};
  for (Eigen::Index i = 0; i < data.points.cols(); ++i) {
    for (double& x : data.points.col(i)) x = stream.Normal() + (i % 3 == 0 ? 3 : 0);
  }
  for (auto _ : state)
    benchmark::DoNotOptimize(FitDirichletMixture(data, {.seed = 1})->lower_bound);
}
BENCHMARK(BM_MixtureFit)
    ->Args({100, 4})
    ->Args({100, 7})
    ->Args({500, 7})
    ->Args({2000, 4})
    ->Args({2000, 7})
    ->Unit(benchmark::kMillisecond);

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

// The response surface with n values, one more value and the next point in 5 dimensions.
void BM_NextPoint(benchmark::State& state) {
  ResponseSurfaceOptions options{.dimensions = 5, .max_evaluations = 1 << 20, .seed = 1};
  options.initial_points = static_cast<int>(state.range(0));
  ResponseSurfaceState begun;
  begun.step = options.max_step;
  begun.design = ScrambledSobol(options.initial_points, 5, 1);
  CubicRbf surrogate(5);
  const auto value = [](const Eigen::VectorXd& x) { return (x.array() - 0.3).square().sum(); };
  for (int k = 0; k < options.initial_points; ++k) {
    const auto point = NextPoint(options, begun, surrogate);
    if (!Report(options, k, value(*point), begun).ok()) return state.SkipWithError("report");
  }
  NextPoint(options, begun, surrogate);  // brings the interpolant up to date
  const auto last = static_cast<int>(begun.evaluations.size()) - 1;
  if (!Report(options, last, 1.0, begun).ok()) return state.SkipWithError("report");
  for (auto _ : state) {
    state.PauseTiming();
    ResponseSurfaceState one = begun;
    CubicRbf own = surrogate;  // lacks the last value
    state.ResumeTiming();
    benchmark::DoNotOptimize(NextPoint(options, one, own));
  }
}
BENCHMARK(BM_NextPoint)->Arg(100)->Arg(1000)->Unit(benchmark::kMillisecond);

// The interpolant of n values from nothing, as the first choice after a server has started has it.
void BM_RebuiltInterpolant(benchmark::State& state) {
  const Eigen::MatrixXd points = ScrambledSobol(static_cast<int>(state.range(0)), 5, 1);
  for (auto _ : state) {
    CubicRbf surrogate(5);
    for (Eigen::Index i = 0; i < points.rows(); ++i) {
      const Eigen::VectorXd point = points.row(i);
      surrogate.Add(point, (point.array() - 0.3).square().sum()).IgnoreError();
    }
    benchmark::DoNotOptimize(surrogate.tail()[0]);
  }
}
BENCHMARK(BM_RebuiltInterpolant)->Arg(100)->Arg(1000)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace calib::inference

BENCHMARK_MAIN();
