#pragma once
// A simulator in closed form with two tests, a base model of two parameters, six effects, packings:
// histories as a diagnosis gets them.

#include <Eigen/Dense>
#include <cmath>
#include <map>
#include <random>
#include <vector>

#include "inference/diagnosis/stage_coordinates.h"

namespace calib::inference {

/// Two curves of each of two tests, 24 readings each: loaded, unloaded, loaded again.
class HistoryToy {
 public:
  static constexpr Eigen::Index kReadings = 24, kCurves = 4, kAll = kReadings * kCurves;
  static constexpr int kEffects = 6;

  explicit HistoryToy(unsigned seed) : random_(seed) {
    for (Eigen::Index i = 0; i < kReadings; ++i) {
      stage_.push_back(i < 12 ? 0 : i < 16 ? 1 : 2);
      const auto n = static_cast<double>(i + 1);
      strain_.push_back(i < 12 ? n / 20 : i < 16 ? 0.6 - 0.03 * (n - 12) : 0.48 + (n - 16) / 15);
    }
  }

  std::vector<PathCurve> Curves() const {
    PathCurve curve{.stage = stage_, .path = Eigen::VectorXd(kReadings)};
    double path = 0, last = 0;
    for (Eigen::Index i = 0; i < kReadings; ++i) {
      const double e = strain_[static_cast<std::size_t>(i)];
      path += std::abs(e - last);
      last = e;
      curve.path[i] = path;
    }
    return std::vector<PathCurve>(kCurves, curve);
  }
  /// Effects 0 and 5 are alike but for how they depend on the second test; 4 has both signs.
  static std::vector<DesignEffect> Effects() {
    std::vector<DesignEffect> effects(kEffects);
    effects[1].power = 0.75;
    effects[4].two_sided = true;
    return effects;
  }

  Eigen::RowVectorXd Mean(const DesignPoints& points, Eigen::Index row) const {
    const double x = points.base(row, 0), y = points.base(row, 1);
    const Eigen::RowVectorXd s = points.strength.row(row);
    Eigen::RowVectorXd result(kAll);
    for (Eigen::Index c = 0; c < kCurves; ++c) {
      const double other = c >= 2 ? 1 : 0, volume = static_cast<double>(c % 2);
      for (Eigen::Index i = 0; i < kReadings; ++i) {
        const double e = strain_[static_cast<std::size_t>(i)];
        const int stage = stage_[static_cast<std::size_t>(i)];
        const double a = 1 + 0.2 * x + 0.05 * x * y + 0.2 * other - 0.4 * volume;
        const double b = 5 * std::exp(0.3 * y - 0.2 * other);
        double value = a * std::tanh(b * e) + volume * (0.3 + 0.2 * y) * e * e;
        value += 0.05 * s[0] * (1 + 0.3 * x) * std::sin(4 * e) * (1 - 0.3 * other);
        value += 0.1 * std::pow(s[1], 0.75) * std::exp(-8 * e) * 10 * e * (1 - 2 * volume);
        value -= 0.04 * s[2] * (stage == 1 ? 1 : 0) * (1 + 0.2 * y) * (1 - 0.5 * volume);
        value -= 0.06 * s[3] * e * e * (1 - volume);
        value += 0.04 * s[4] * e * (1 - 2 * other) + 0.002 * s[4] * s[4] * e;
        value += 0.05 * s[5] * (1 + 0.2 * y) * std::sin(4 * e) * (1 + 0.1 * other) * (1 - volume);
        value += 0.01 * s[0] * s[3] * e;  // pairs that no additive emulator has
        result[c * kReadings + i] = value;
      }
    }
    return result;
  }

  /// Histories of runs on packings: the mean, the packing's departure, the run's.
  Eigen::MatrixXd Run(const DesignPoints& points, const std::vector<int>& packing) {
    Eigen::MatrixXd result(points.rows(), kAll);
    for (Eigen::Index i = 0; i < points.rows(); ++i) {
      auto [place, fresh] = packings_.try_emplace(packing[static_cast<std::size_t>(i)]);
      if (fresh) place->second = Departure(kScatter);
      result.row(i) = Mean(points, i) + place->second + Departure(kScatter);
    }
    return result;
  }
  /// What a laboratory reads of a specimen of its own.
  Eigen::RowVectorXd Measure(const DesignPoints& point) {
    Eigen::RowVectorXd result = Mean(point, 0) + Departure(kScatter) + Departure(kScatter);
    for (double& value : result) value += kNoise * normal_(random_);
    return result;
  }
  static constexpr double kNoise = 0.008, kScatter = 0.012;
  /// Departures of n twins of such scatter from their mean.
  Eigen::MatrixXd Twins(Eigen::Index n, double scatter) {
    Eigen::MatrixXd result(n, kAll);
    for (Eigen::Index i = 0; i < n; ++i) result.row(i) = Departure(scatter);
    return result.rowwise() - result.colwise().mean();
  }

  DesignPoints Points(Eigen::Index n, int on, double low = 0.4, double high = 5) {
    DesignPoints points{.base = Eigen::MatrixXd(n, 2),
                        .strength = Eigen::MatrixXd::Zero(n, kEffects),
                        .shape = Eigen::MatrixXd(n, 0)};
    for (double& x : points.base.reshaped()) x = 2 * Uniform() - 1;
    for (Eigen::Index i = 0; i < n; ++i) {
      for (int k = 0; k < on; ++k) {
        const auto effect = (i + k * (1 + (i / kEffects) % (kEffects - 1))) % kEffects;
        const double s = low * std::pow(high / low, Uniform());
        points.strength(i, effect) = effect == 4 && Uniform() < 0.5 ? -s : s;
      }
    }
    return points;
  }

  /// Base runs, then runs with two effects on.
  SetRuns Runs(Eigen::Index without, Eigen::Index with, int packings) {
    const DesignPoints a = Points(without, 0), b = Points(with, 2);
    SetRuns runs{.curves = Curves(), .effects = Effects(), .points = {}};
    runs.points = {.base = Eigen::MatrixXd(without + with, 2),
                   .strength = Eigen::MatrixXd(without + with, kEffects),
                   .shape = Eigen::MatrixXd(without + with, 0)};
    runs.points.base << a.base, b.base;
    runs.points.strength << a.strength, b.strength;
    for (Eigen::Index i = 0; i < without + with; ++i)
      runs.packing.push_back(static_cast<int>(i) % packings);
    runs.histories = Run(runs.points, runs.packing);
    runs.noise = kNoise * kNoise * Eigen::MatrixXd::Identity(kAll, kAll);
    return runs;
  }

  double Uniform() { return std::uniform_real_distribution<double>()(random_); }

 private:
  // Smooth along the path, in each curve by itself.
  Eigen::RowVectorXd Departure(double sd) {
    Eigen::RowVectorXd result(kAll);
    for (Eigen::Index c = 0; c < kCurves; ++c) {
      Eigen::Vector4d z;
      for (double& value : z) value = sd * normal_(random_);
      for (Eigen::Index i = 0; i < kReadings; ++i) {
        const double e = strain_[static_cast<std::size_t>(i)];
        result[c * kReadings + i] =
            std::tanh(8 * e) * (z[0] + z[1] * std::cos(3 * e) + z[2] * std::cos(6 * e)) +
            0.5 * z[3] * (stage_[static_cast<std::size_t>(i)] == 1 ? 1 : 0);
      }
    }
    return result;
  }

  std::mt19937 random_;
  std::normal_distribution<double> normal_;
  std::vector<int> stage_;
  std::vector<double> strain_;
  std::map<int, Eigen::RowVectorXd> packings_;
};

}  // namespace calib::inference
