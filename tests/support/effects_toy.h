#pragma once
// Runs with few effects on, drawn from the very model that a FeatureEmulator takes for true.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <utility>
#include <vector>

#include "inference/diagnosis/diagnosis_set.h"
#include "inference/diagnosis/feature_emulator.h"
#include "inference/diagnosis/model_space.h"

namespace calib::inference {

/// Coordinates of runs: coefficients, packings and runs are normal with known variances.
class CoordinateToy {
 public:
  struct Options {
    Eigen::Index parameters = 2;
    int effects = 3;
    Eigen::Index coordinates = 6;
    unsigned seed = 1;
    RunVariance run_variance{};
    int calculated = 0;  // so many of the last effects are calculated on curves
    double largest = 5;  // strength of a run
    std::vector<int> two_sided{};
    double slope = 4;  // prior variance of the base parameters' slopes
    double main = 1;   // prior variance of an effect's main coefficients
    int degree = 2;
  };

  explicit CoordinateToy(const Options& options)
      : options_(options),
        features_(options.parameters, EffectsOf(options), options.degree),
        random_(options.seed) {
    variances_.group.resize(static_cast<Eigen::Index>(features_.groups().size()));
    for (Eigen::Index g = 0; g < variances_.group.size(); ++g)
      variances_.group[g] = TrueVariance(features_.groups()[static_cast<std::size_t>(g)]);
    variances_.packing = 0.3;
    variances_.run = Eigen::VectorXd::Constant(options.coordinates, 0.7);
    coefficients_ = FeatureVariances().cwiseSqrt().asDiagonal() *
                    Normal(features_.count(), options.coordinates);
  }

  const EffectFeatures& features() const { return features_; }
  const EmulatorVariances& Variances() const { return variances_; }
  Eigen::VectorXd FeatureVariances() const {
    Eigen::VectorXd tau(features_.count());
    for (Eigen::Index i = 0; i < tau.size(); ++i)
      tau[i] = variances_.group[features_.group_of()[static_cast<std::size_t>(i)]];
    return tau;
  }

  /// n points, base parameters in [-1, 1], `on` effects in each with strengths log-uniform.
  DesignPoints Points(Eigen::Index n, int on) {
    DesignPoints points{.base = Eigen::MatrixXd(n, options_.parameters),
                        .strength = Eigen::MatrixXd::Zero(n, options_.effects),
                        .shape = Eigen::MatrixXd(n, 0)};
    for (double& x : points.base.reshaped()) x = 2 * Uniform() - 1;
    for (Eigen::Index i = 0; i < n; ++i) {
      for (int k = 0; k < on; ++k) {
        // In turn, so that each effect is on equally often.
        const auto effect =
            (i + k * (1 + i % std::max(1, options_.effects - 1))) % options_.effects;
        const double s = 0.4 * std::pow(options_.largest / 0.4, Uniform());
        const bool minus =
            features_.effects()[static_cast<std::size_t>(effect)].two_sided && Uniform() < 0.5;
        points.strength(i, effect) = minus ? -s : s;
      }
    }
    return points;
  }

  Eigen::MatrixXd Mean(const DesignPoints& points) const {
    return features_.All(points) * coefficients_;
  }

  Eigen::MatrixXd Outputs(const DesignPoints& points, const std::vector<int>& packing) {
    Eigen::MatrixXd result = Mean(points);
    const Eigen::MatrixXd terms = features_.VarianceTerms(points);
    for (Eigen::Index i = 0; i < result.rows(); ++i) {
      auto [place, fresh] = packings_.try_emplace(packing[static_cast<std::size_t>(i)]);
      if (fresh)
        place->second = std::sqrt(variances_.packing) * Normal(1, options_.coordinates).row(0);
      const double more =
          1 + options_.run_variance.single * terms(i, 0) + options_.run_variance.pair * terms(i, 1);
      result.row(i) +=
          place->second + std::sqrt(0.7 * more) * Normal(1, options_.coordinates).row(0);
    }
    return result;
  }

  /// Runs without effects, then runs with two on, on packings in turn.
  EmulatorData Runs(Eigen::Index without, Eigen::Index with, int packings) {
    const DesignPoints a = Points(without, 0), b = Points(with, options_.effects > 1 ? 2 : 1);
    EmulatorData data;
    data.points = {.base = Eigen::MatrixXd(without + with, options_.parameters),
                   .strength = Eigen::MatrixXd(without + with, options_.effects),
                   .shape = Eigen::MatrixXd(without + with, 0)};
    data.points.base << a.base, b.base;
    data.points.strength << a.strength, b.strength;
    for (Eigen::Index i = 0; i < without + with; ++i)
      data.packing.push_back(static_cast<int>(i) % packings);
    data.outputs = Outputs(data.points, data.packing);
    return data;
  }

  /// What a calculated effect changes at n of these points.
  CalculatedDifferences Differences(const DesignPoints& at, int effect, Eigen::Index n) {
    CalculatedDifferences result;
    std::vector<Eigen::Index> rows;
    for (Eigen::Index i = 0; i < n; ++i) rows.push_back(i);
    result.without = result.with = RowsOf(at, rows);
    for (Eigen::Index i = 0; i < n; ++i) result.with.strength(i, effect) = 0.5 + 3 * Uniform();
    result.outputs = Mean(result.with) - Mean(result.without);
    return result;
  }

  double Uniform() { return std::uniform_real_distribution<double>()(random_); }
  Eigen::MatrixXd Normal(Eigen::Index rows, Eigen::Index columns) {
    std::normal_distribution<double> normal;
    Eigen::MatrixXd result(rows, columns);
    for (double& x : result.reshaped()) x = normal(random_);
    return result;
  }

 private:
  static std::vector<DesignEffect> EffectsOf(const Options& options) {
    std::vector<DesignEffect> effects(static_cast<std::size_t>(options.effects));
    for (int k = 0; k < options.effects; ++k) {
      effects[static_cast<std::size_t>(k)] = {
          .power = k % 2 == 0 ? 1.0 : 0.75,
          .calculated = k >= options.effects - options.calculated};
    }
    for (const int k : options.two_sided) effects[static_cast<std::size_t>(k)].two_sided = true;
    return effects;
  }

  double TrueVariance(const FeatureGroup& group) const {
    switch (group.kind) {
      case FeatureKind::kBase:
        return group.number == 1 ? options_.slope : group.number == 2 ? 0.5 : 1;
      case FeatureKind::kMain:
        return options_.main;
      case FeatureKind::kCurvatureByBase:
        return 0.02;
      default:
        return 0.1;
    }
  }

  Options options_;
  EffectFeatures features_;
  std::mt19937 random_;
  EmulatorVariances variances_;
  Eigen::MatrixXd coefficients_;
  std::map<int, Eigen::RowVectorXd> packings_;
};

/// A space of models for points of such a toy.
inline ModelSpace ToySpace(const CoordinateToy& toy, double high = 5) {
  ModelSpace space{.effects = toy.features().effects()};
  const auto k = space.effects.size();
  space.strength.assign(k, {.low = 0.4, .high = high, .negative_low = 0.4, .negative_high = high});
  space.shape_low = space.shape_high = Eigen::VectorXd(0);
  space.base_low = Eigen::VectorXd::Constant(toy.features().parameters(), -1);
  space.base_high = Eigen::VectorXd::Constant(toy.features().parameters(), 1);
  space.models = AllModels(static_cast<int>(k), {});
  return space;
}

/// A set whose variances are the true ones: coordinates of scatter one, noise 0.2.
inline DiagnosisSet SetOf(const CoordinateToy& toy, const EmulatorData& data,
                          double freedom = std::numeric_limits<double>::infinity()) {
  auto emulator =
      FeatureEmulator::Fit(toy.features(), data, {.start = toy.Variances(), .hold = true});
  EXPECT_TRUE(emulator.ok()) << emulator.status();
  const Eigen::Index q = data.outputs.cols();
  SpecimenErrors errors{.specimen = emulator->specimen(),
                        .run = emulator->variances().run,
                        .noise = Eigen::VectorXd::Constant(q, 0.2),
                        .staging = Eigen::MatrixXd(q, 0),
                        .share = 1,
                        .freedom = freedom};
  return {*std::move(emulator), std::move(errors)};
}

}  // namespace calib::inference
