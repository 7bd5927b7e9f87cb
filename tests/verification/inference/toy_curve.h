#pragma once
// A stand-in for a granular run: stress ratio and volume along a strain path, with scatter that is
// correlated along the path, as perturbed repeats of a granular simulation have.

#include <Eigen/Dense>
#include <cmath>
#include <cstdint>
#include <vector>

#include "inference/prior/prior.h"
#include "tests/verification/inference/path_scatter.h"

namespace calib::inference {

/// d <= 5 parameters in [0, 1]: stiffness, strength, strain at peak, softening, dilatancy. Half of
/// the readings are a stress ratio that hardens to a peak and softens, half a volume ratio.
struct ToyCurve {
  int d = 3;
  int readings = 44;
  double scatter =
      0.005;             ///< relative sd of one run about the mean curve, correlated along the path
  double roughness = 0;  ///< relative amplitude of a response that no smooth emulator can follow

  std::vector<Prior> Priors() const {
    return std::vector<Prior>(static_cast<std::size_t>(d),
                              Prior{.kind = PriorKind::kUniform, .min = 0, .max = 1});
  }

  Eigen::VectorXd Mean(const Eigen::VectorXd& parameters) const {
    Eigen::VectorXd p = Eigen::VectorXd::Constant(5, 0.5);
    p.head(d) = parameters;
    Eigen::VectorXd curve(readings);
    const int half = readings / 2;
    for (int t = 0; t < half; ++t) {
      const double strain = (t + 1.0) / half;
      const double peak = 2.2 + 2 * p[1] + 0.5 * p[2] * p[1];
      const double hardening = 1 + (peak - 1) * (1 - std::exp(-(4 + 8 * p[0]) * strain));
      const double softening =
          1 - 0.25 * p[3] * std::max(0.0, std::tanh(3 * (strain - 0.2 - 0.3 * p[2])));
      const double contraction = 0.8 * p[4] * strain * std::exp(-2 * strain);
      const double dilation =
          (0.3 + 1.5 * p[1] * (1 - 0.5 * p[3])) * strain * strain / (0.3 + strain);
      curve[t] = hardening * softening;
      curve[half + t] = 1 + 0.05 * (dilation - contraction + 0.3 * p[0] * strain);
    }
    for (int t = 0; t < readings; ++t)
      curve[t] *= 1 + roughness * std::sin(25 * p[0] + 18 * p[1] + 0.05 * t);
    return curve;
  }

  Eigen::VectorXd Run(const Eigen::VectorXd& parameters, std::uint64_t seed,
                      std::uint64_t sample) const {
    PhiloxStream stream = StreamOfRun(seed, sample);
    Eigen::VectorXd curve = Mean(parameters);
    PathScatter deviation(stream);
    const int of_each = readings / 2;
    for (int t = 0; t < readings; ++t) {
      const double strain = static_cast<double>(t % of_each) / of_each;
      curve[t] *= 1 + scatter * deviation.Next(strain);
    }
    return curve;
  }

  /// One run at the parameters, measured with independent errors of the relative sd `noise`.
  DataSet Measure(const Eigen::VectorXd& parameters, double noise, std::uint64_t seed) const {
    const Eigen::VectorXd curve = Run(parameters, seed, kMeasured);
    std::vector<double> steps;
    steps.reserve(static_cast<std::size_t>(readings) / 2);
    for (int t = 0; t < readings / 2; ++t) steps.push_back(t);
    return WithErrors(curve, noise * curve, steps, seed);
  }
};

}  // namespace calib::inference
