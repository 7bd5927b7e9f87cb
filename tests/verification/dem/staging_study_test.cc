// Quasi-static means that the curve no longer depends on the rate: mean curves of perturbed repeats
// at several inertial numbers, and the scatter of the repeats beside them. Slow; run the binary
// itself.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tests/verification/dem/yade_cases.h"

namespace calib::dem {
namespace {

constexpr int kRepeats = 4;

struct Curve {
  std::vector<double> ratio;   ///< mean stress ratio per load step
  std::vector<double> volume;  ///< mean volumetric strain
  double ratio_scatter = 0;    ///< rms sd of one run over the largest mean ratio
  double volume_scatter = 0;
  double steps = 0;
};

/// Mean over perturbed repeats.
Curve MeanCurve(const Scenario& scenario) {
  std::vector<test::Run> runs;
  for (int r = 0; r < kRepeats; ++r) {
    runs.push_back(test::RunAll(test::Perturbed(scenario, r)));
    EXPECT_EQ(runs.back().summary.outcome, Outcome::kCompleted) << runs.back().summary.reason;
  }
  Curve curve;
  double ratio2 = 0;
  double volume2 = 0;
  for (std::size_t k = 0; k < runs[0].states.size(); ++k) {
    double ratio = 0;
    double volume = 0;
    for (const test::Run& run : runs) {
      ratio += test::Observable(run.states[k], "stress_ratio") / kRepeats;
      volume += test::Observable(run.states[k], "volumetric_strain") / kRepeats;
    }
    for (const test::Run& run : runs) {
      ratio2 +=
          std::pow(test::Observable(run.states[k], "stress_ratio") - ratio, 2) / (kRepeats - 1);
      volume2 += std::pow(test::Observable(run.states[k], "volumetric_strain") - volume, 2) /
                 (kRepeats - 1);
    }
    curve.ratio.push_back(ratio);
    curve.volume.push_back(volume);
  }
  const double n = static_cast<double>(curve.ratio.size());
  curve.ratio_scatter =
      std::sqrt(ratio2 / n) / *std::max_element(curve.ratio.begin(), curve.ratio.end());
  curve.volume_scatter = std::sqrt(volume2 / n);
  curve.steps = static_cast<double>(runs[0].summary.steps);
  return curve;
}

double Rms(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    sum += (a[k] - b[k]) * (a[k] - b[k]);
  }
  return std::sqrt(sum / static_cast<double>(a.size()));
}

/// Runs the base case with real density at multiples of the rate that the engine chooses by itself.
void StudyRate(double pressure) {
  std::vector<double> strains;
  for (int k = 0; k <= 40; ++k) {
    strains.push_back(0.002 * k);
  }
  Scenario scenario = test::CaseScenario("base", "triaxial_drained", pressure, strains);
  scenario.model.density = 2650;
  scenario.staging = {};
  Scenario first_step = scenario;
  first_step.path.resize(1);
  const double chosen = *test::RunAll(first_step).summary.staging.rate;
  std::vector<Curve> curves;
  const std::vector<double> factors = {0.25, 0.5, 1, 2, 4};
  for (const double factor : factors) {
    scenario.staging.rate = factor * chosen;
    curves.push_back(MeanCurve(scenario));
  }
  const double largest = *std::max_element(curves[0].ratio.begin(), curves[0].ratio.end());
  for (std::size_t k = 0; k < curves.size(); ++k) {
    std::printf(
        "%.1f MPa rate %.2f x chosen: stress ratio %.2f %%, volumetric strain %.1e from the "
        "slowest; one run "
        "scatters %.2f %%, %.1e; %.0f steps\n",
        pressure / 1e6, factors[k], 100 * Rms(curves[k].ratio, curves[0].ratio) / largest,
        Rms(curves[k].volume, curves[0].volume), 100 * curves[k].ratio_scatter,
        curves[k].volume_scatter, curves[k].steps);
  }
  EXPECT_LT(Rms(curves[2].ratio, curves[0].ratio) / largest, 2 * curves[0].ratio_scatter);
}

TEST(StagingSlow, ChosenRateIsQuasiStaticAt05MPa) { StudyRate(5e5); }
TEST(StagingSlow, ChosenRateIsQuasiStaticAt02MPa) { StudyRate(2e5); }

}  // namespace
}  // namespace calib::dem
