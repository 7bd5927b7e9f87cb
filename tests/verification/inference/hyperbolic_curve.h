#pragma once
// A stand-in for the DEM of a drained triaxial test in closed form, with the scatter of a run.

#include <Eigen/Dense>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "inference/prior/prior.h"
#include "tests/verification/inference/path_scatter.h"

namespace calib::inference {

/// Hyperbolic stress-strain curve [Kondner 1963; Duncan & Chang 1970] at a confining pressure of
/// 0.2 MPa, and the volumetric strain that follows from an elastic contraction which turns into
/// dilation as the strength is mobilised:
///   q = e / (1 / E + R e / q_f),  q_f = s 2 sin(phi) / (1 - sin(phi)),
///   d e_v / d e = c - (c + 2 sin(psi) / (1 - sin(psi))) m,  m = e / (a + e), a = q_f / (R E).
/// Parameters: initial modulus E [Pa], friction angle phi and dilation angle psi [deg], failure
/// ratio R. Readings: the stress ratio at 25 axial strains up to 15 %, then the volumetric strain
/// there.
struct HyperbolicCurve {
  static constexpr int d = 4;
  static constexpr int kSteps = 25;
  static constexpr int readings = 2 * kSteps;
  static constexpr double kPressure = 0.2e6;   // Pa
  static constexpr double kContraction = 0.4;  // c = 1 - 2 nu, nu = 0.3
  static constexpr double kVolumeSd = 5e-4;    // about 1 % of the range of volumetric strains
  static constexpr double kScatter = 0.005;    // of a run, half the noise

  std::vector<Prior> Priors() const {
    return {{.kind = PriorKind::kLogUniform, .min = 2e7, .max = 2e8},
            {.kind = PriorKind::kUniform, .min = 25, .max = 45},
            {.kind = PriorKind::kUniform, .min = 0, .max = 15},
            {.kind = PriorKind::kUniform, .min = 0.7, .max = 1}};
  }

  Eigen::VectorXd Mean(const Eigen::VectorXd& p) const {
    const double sin_phi = std::sin(p[1] * std::numbers::pi / 180);
    const double sin_psi = std::sin(p[2] * std::numbers::pi / 180);
    const double strength = kPressure * 2 * sin_phi / (1 - sin_phi);
    const double a = strength / (p[3] * p[0]);
    Eigen::VectorXd curve(readings);
    for (int t = 0; t < kSteps; ++t) {
      const double strain = Strain(t);
      const double q = strain / (1 / p[0] + p[3] * strain / strength);
      const double mobilised = strain - a * std::log1p(strain / a);
      curve[t] = 1 + q / kPressure;
      curve[kSteps + t] =
          kContraction * strain - (kContraction + 2 * sin_psi / (1 - sin_psi)) * mobilised;
    }
    return curve;
  }

  /// The mean curve and what a packing differs from it by: level, slope and a random walk.
  Eigen::VectorXd Run(const Eigen::VectorXd& parameters, std::uint64_t seed,
                      std::uint64_t sample) const {
    PhiloxStream stream = StreamOfRun(seed, sample);
    Eigen::VectorXd curve = Mean(parameters);
    for (const int first : {0, kSteps}) {
      PathScatter scatter(stream);
      for (int t = 0; t < kSteps; ++t) {
        const double unit = first == 0 ? curve[t] : kVolumeSd / 0.01;
        curve[first + t] += kScatter * unit * scatter.Next(static_cast<double>(t) / kSteps);
      }
    }
    return curve;
  }

  /// One run at the parameters, measured with independent errors: `noise` times the stress ratio,
  /// and as many hundredths of kVolumeSd.
  DataSet Measure(const Eigen::VectorXd& parameters, double noise, std::uint64_t seed) const {
    const Eigen::VectorXd curve = Run(parameters, seed, kMeasured);
    Eigen::VectorXd sd = Eigen::VectorXd::Constant(readings, noise * kVolumeSd / 0.01);
    sd.head(kSteps) = noise * curve.head(kSteps);
    std::vector<double> strains;
    strains.reserve(kSteps);
    for (int t = 0; t < kSteps; ++t) strains.push_back(Strain(t));
    return WithErrors(curve, sd, strains, seed);
  }

 private:
  static double Strain(int t) { return 0.15 * (t + 1) / kSteps; }
};

}  // namespace calib::inference
