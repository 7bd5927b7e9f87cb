// Quasi-static means that the curve no longer depends on the rate: mean curves of perturbed repeats
// at several inertial numbers, and the scatter of the repeats beside them. Adaptive staging has to
// reach the same curve: pairs of runs. Slow; run the binary itself.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/dem/yade_cases.h"

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
  const std::vector<double> factors = {0.5, 1, 2, 4};
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
  EXPECT_LT(Rms(curves[1].ratio, curves[0].ratio) / largest, 2 * curves[0].ratio_scatter);
}

constexpr int kPairs = 8;

/// Values of an observable, by repeat and load step.
using Sheaf = std::vector<std::vector<double>>;

struct Repeats {
  std::map<std::string, Sheaf> values;
  double steps = 0;
};

Repeats RunRepeats(const Scenario& scenario, const std::vector<std::string>& observables) {
  Repeats repeats;
  for (int r = 0; r < kPairs; ++r) {
    const test::Run run = test::RunAll(test::Perturbed(scenario, r));
    EXPECT_EQ(run.summary.outcome, Outcome::kCompleted) << run.summary.reason;
    repeats.steps += static_cast<double>(run.summary.steps) / kPairs;
    for (const std::string& name : observables) {
      std::vector<double>& row = repeats.values[name].emplace_back();
      for (const State& state : run.states) {
        row.push_back(test::Observable(state, name));
      }
    }
  }
  return repeats;
}

/// What the mean of paired differences amounts to along the path.
struct Shift {
  double rms = 0;    ///< over the largest mean value
  double error = 0;  ///< the same of its standard errors
  int beyond = 0;    ///< load steps where it exceeds two standard errors
};

Shift ShiftOf(const Sheaf& from, const Sheaf& to) {
  const std::size_t steps = from[0].size();
  double mean2 = 0;
  double error2 = 0;
  double largest = 0;
  Shift shift;
  for (std::size_t k = 0; k < steps; ++k) {
    double mean = 0;
    double level = 0;
    for (std::size_t r = 0; r < kPairs; ++r) {
      mean += (to[r][k] - from[r][k]) / kPairs;
      level += from[r][k] / kPairs;
    }
    double scatter2 = 0;
    for (std::size_t r = 0; r < kPairs; ++r) {
      scatter2 += std::pow(to[r][k] - from[r][k] - mean, 2) / (kPairs - 1);
    }
    mean2 += mean * mean / static_cast<double>(steps);
    error2 += scatter2 / kPairs / static_cast<double>(steps);
    largest = std::max(largest, std::abs(level));
    shift.beyond += std::abs(mean) > 2 * std::sqrt(scatter2 / kPairs) ? 1 : 0;
  }
  shift.rms = std::sqrt(mean2) / largest;
  shift.error = std::sqrt(error2) / largest;
  return shift;
}

/// Eight pairs of runs, fixed staging against adaptive, and against half and twice the rate.
void StudyAdaptive(const std::string& name, const std::string& test, double pressure,
                   const std::vector<double>& strains) {
  Scenario fixed = test::CaseScenario(name, test, pressure, strains);
  fixed.model.density = 2650;
  fixed.staging = {};
  const std::vector<std::string> observables =
      test == "oedometric" ? std::vector<std::string>{"axial_stress", "lateral_stress"}
                           : std::vector<std::string>{"stress_ratio", "volumetric_strain"};
  Scenario first_step = fixed;
  first_step.path.resize(1);
  const double chosen = *test::RunAll(first_step).summary.staging.rate;
  const Repeats base = RunRepeats(fixed, observables);
  std::printf("%s %s %.1f MPa, %zu states, fixed staging: %.0f steps\n", name.c_str(), test.c_str(),
              pressure / 1e6, strains.size(), base.steps);
  const auto report = [&](const char* what, const Scenario& scenario) {
    const Repeats repeats = RunRepeats(scenario, observables);
    std::printf("  %-12s %6.0f steps (%+.0f %%)", what, repeats.steps,
                100 * (repeats.steps / base.steps - 1));
    std::vector<Shift> shifts;
    for (const std::string& o : observables) {
      shifts.push_back(ShiftOf(base.values.at(o), repeats.values.at(o)));
      std::printf("; %s %.2f %%, standard error %.2f %%, beyond two: %d", o.c_str(),
                  100 * shifts.back().rms, 100 * shifts.back().error, shifts.back().beyond);
    }
    std::printf("\n");
    return std::pair(shifts, repeats.steps);
  };
  Scenario other = fixed;
  other.staging.adaptive = true;
  const auto [adaptive, steps] = report("adaptive", other);
  other = fixed;
  other.staging.rate = 0.5 * chosen;
  const auto half = report("rate halved", other).first;
  other.staging.rate = 2 * chosen;
  const auto twice = report("rate doubled", other).first;
  EXPECT_LT(steps, base.steps);
  // Beside chance, not beyond what the rate does; a thousandth counts as nothing (oedometric curves
  // repeat to the last digits).
  constexpr double kNothing = 1e-3;
  for (std::size_t o = 0; o < observables.size(); ++o) {
    EXPECT_LT(adaptive[o].rms,
              std::max({half[o].rms, twice[o].rms, kNothing}) + 2 * adaptive[o].error);
  }
}

std::vector<double> Strains(double step, int count) {
  std::vector<double> strains;
  for (int k = 0; k <= count; ++k) {
    strains.push_back(step * k);
  }
  return strains;
}

/// To 2 %, back to 1.2 % and to 2 % again.
std::vector<double> Cycle() {
  std::vector<double> strains = Strains(0.002, 10);
  for (const double k : {9, 8, 7, 6, 7, 8, 9, 10}) {
    strains.push_back(0.002 * k);
  }
  return strains;
}

TEST(StagingSlow, AdaptiveBaseAt05MPa) {
  StudyAdaptive("base", "triaxial_drained", 5e5, Strains(0.004, 20));
}
TEST(StagingSlow, AdaptiveBaseAt05MPaWithFewReadings) {
  StudyAdaptive("base", "triaxial_drained", 5e5, Strains(0.02, 4));
}
TEST(StagingSlow, AdaptiveLinearAt02MPa) {
  StudyAdaptive("linear", "triaxial_drained", 2e5, Strains(0.004, 20));
}
TEST(StagingSlow, AdaptiveRollingAt1MPa) {
  StudyAdaptive("rolling", "triaxial_drained", 1e6, Strains(0.004, 20));
}
TEST(StagingSlow, AdaptiveBaseOedometric) { StudyAdaptive("base", "oedometric", 1e5, Cycle()); }
TEST(StagingSlow, AdaptiveRollingOedometric) {
  StudyAdaptive("rolling", "oedometric", 1e5, Cycle());
}

TEST(StagingSlow, ChosenRateIsQuasiStaticAt05MPa) { StudyRate(5e5); }
TEST(StagingSlow, ChosenRateIsQuasiStaticAt02MPa) { StudyRate(2e5); }

}  // namespace
}  // namespace calib::dem
