// Linear algebra of a diagnosis by probabilities: coordinates and emulator of a design, evidences
// of base, singles, pairs, leading triples and none of these under three priors on strengths. 256
// runs; parameters, effects, tests.

#include <benchmark/benchmark.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "inference/diagnosis/effect_probabilities.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// Smooth curves with random shapes, two of 24 readings for each test.
class RandomDesign {
 public:
  RandomDesign(Index parameters, int effects, int tests) : readings_(48 * tests) {
    runs_.effects.resize(static_cast<std::size_t>(effects));
    PathCurve curve{.stage = {}, .path = Eigen::VectorXd::LinSpaced(24, 0.04, 1)};
    for (int i = 0; i < 24; ++i) curve.stage.push_back(i < 12 ? 0 : i < 16 ? 1 : 2);
    runs_.curves.assign(static_cast<std::size_t>(2 * tests), curve);
    constexpr Index kBase = 96, kAll = 256;
    runs_.points = {.base = Eigen::MatrixXd(kAll, parameters),
                    .strength = Eigen::MatrixXd::Zero(kAll, effects),
                    .shape = Eigen::MatrixXd(kAll, 0)};
    std::uniform_real_distribution<double> uniform;
    for (double& x : runs_.points.base.reshaped()) x = 2 * uniform(random_) - 1;
    for (Index i = kBase; i < kAll; ++i) {
      for (int k = 0; k < 3; ++k) {
        runs_.points.strength(i, (i + k * (1 + i % (effects - 1))) % effects) =
            0.4 * std::pow(40, uniform(random_));
      }
    }
    for (Index i = 0; i < kAll; ++i) runs_.packing.push_back(static_cast<int>(i % 16));
    const Eigen::MatrixXd slopes = Shapes(parameters), curvatures = Shapes(parameters);
    const Eigen::MatrixXd signatures = Shapes(effects), packings = Shapes(16);
    const Eigen::MatrixXd squared = runs_.points.base.cwiseAbs2();
    runs_.histories =
        5 * runs_.points.base * slopes + squared * curvatures + runs_.points.strength * signatures;
    for (Index i = 0; i < kAll; ++i)
      runs_.histories.row(i) += 0.5 * packings.row(i % 16) + 0.5 * Shapes(1).row(0);
    runs_.noise = 0.2 * Eigen::MatrixXd::Identity(readings_, readings_);
    space_.effects = runs_.effects;
    space_.strength.resize(static_cast<std::size_t>(effects));
    space_.shape_low = space_.shape_high = Eigen::VectorXd(0);
    space_.base_low = Eigen::VectorXd::Constant(parameters, -1);
    space_.base_high = Eigen::VectorXd::Constant(parameters, 1);
    const std::vector<std::pair<int, int>> excluded = {{0, 1}, {2, 3}};
    space_.models = AllModels(effects, excluded);
    // As many triples as a diagnosis asks for at most.
    std::vector<EffectModel> triples =
        TriplesOf(effects, excluded, {{.effects = {0, 2}}, {.effects = {1, 4}}});
    triples.resize(std::min<std::size_t>(12, triples.size()));
    space_.models.insert(space_.models.end(), triples.begin(), triples.end());
    space_.triples = CountTriples(effects, excluded);
  }

  const SetRuns& runs() const { return runs_; }
  ModelSpace& space() { return space_; }

 private:
  Eigen::MatrixXd Shapes(Index n) {
    std::normal_distribution<double> normal;
    Eigen::MatrixXd result(n, readings_);
    for (Index i = 0; i < n; ++i) {
      for (Index c = 0; c < readings_ / 24; ++c) {
        const double a = normal(random_), b = normal(random_), d = normal(random_);
        for (Index t = 0; t < 24; ++t) {
          const auto x = static_cast<double>(t + 1) / 24;
          result(i, 24 * c + t) = a * x + b * std::sin(3 * x) + d * (t >= 12 && t < 16 ? 1 : 0);
        }
      }
    }
    return result;
  }

  std::mt19937 random_{5};
  Index readings_;
  SetRuns runs_;
  ModelSpace space_;
};

void BM_DiagnosisFit(benchmark::State& state) {
  RandomDesign design(state.range(0), static_cast<int>(state.range(1)),
                      static_cast<int>(state.range(2)));
  for (auto _ : state) benchmark::DoNotOptimize(DiagnosisSet::Fit(design.runs()));
}

void BM_DiagnosisEvidence(benchmark::State& state) {
  RandomDesign design(state.range(0), static_cast<int>(state.range(1)),
                      static_cast<int>(state.range(2)));
  const auto set = DiagnosisSet::Fit(design.runs());
  if (!set.ok()) {
    state.SkipWithError("no emulator");
    return;
  }
  const Eigen::VectorXd z = set->coordinates()->Of(design.runs().histories.row(200)).row(0);
  ModelSpace& space = design.space();
  std::vector<std::vector<StrengthPrior>> priors;
  for (const double high : {60.0, 17.0, 5.0})
    priors.emplace_back(space.effects.size(), StrengthPrior{.low = 0.4, .high = high});
  space.strength = priors[0];
  for (auto _ : state) benchmark::DoNotOptimize(ModelEvidencesUnder({{&*set, z}}, space, priors));
}

#define CALIB_DIAGNOSIS_SIZES \
  Args({1, 3, 1})->Args({2, 17, 2})->Args({5, 17, 3})->Unit(benchmark::kSecond)
BENCHMARK(BM_DiagnosisFit)->CALIB_DIAGNOSIS_SIZES;
BENCHMARK(BM_DiagnosisEvidence)->CALIB_DIAGNOSIS_SIZES;

}  // namespace
}  // namespace calib::inference

BENCHMARK_MAIN();
