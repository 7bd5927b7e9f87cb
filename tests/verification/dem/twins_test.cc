// Twins of a run, which a campaign on one packing measures its scatter by: with parameters that
// differ by a millionth they scatter as with grains moved by a millionth of a diameter, once their
// trajectories have parted. A small specimen in the suite, the measured kind by hand (suite
// ...Slow).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include "tests/support/dem/yade_cases.h"

namespace calib::dem {
namespace {

constexpr double kShift = 1e-6;  // of parameters, times the twin, and of diameters

struct Study {
  int grains = 0;
  int twins = 0;
  int readings = 0;  // every half per cent of axial strain
};

using Runs = std::vector<std::vector<State>>;     // [twin][reading]
using Curves = std::vector<std::vector<double>>;  // [twin][reading]

struct Twins {
  Runs by_parameters, by_grains;  // from twin 1 on: the unmoved run is of no kind
};

Scenario Base(const Study& study) {
  Scenario s = test::SmallTriaxial(test::HertzModel());
  s.packing = test::SmallPacking(study.grains);
  s.path.clear();
  for (int k = 0; k < study.readings; ++k) {
    s.path.push_back({.target = 0.005 * (k + 1), .load_step = k});
  }
  return s;
}

// As Planner::Twin of server/scheduler/plan.cc.
Scenario ByParameters(Scenario s, int twin) {
  s.model.parameters["young_modulus"] *= 1 - kShift * twin;
  s.model.parameters["friction_coefficient"] *= 1 + kShift * twin;
  return s;
}

Scenario ByGrains(Scenario s, int twin, double shift) {
  std::mt19937 random(static_cast<unsigned>(twin));
  std::uniform_real_distribution<double> moved(-1, 1);
  for (std::size_t i = 0; i < s.packing.x.size(); ++i) {
    for (double* x : {&s.packing.x[i], &s.packing.y[i], &s.packing.z[i]}) {
      *x += shift * 2 * s.packing.radius[i] * moved(random);
    }
  }
  return s;
}

Twins Simulated(const Study& study) {
  const Scenario base = Base(study);
  Twins twins;
  for (int twin = 1; twin <= study.twins; ++twin) {
    twins.by_parameters.push_back(test::RunAll(ByParameters(base, twin)).states);
    twins.by_grains.push_back(test::RunAll(ByGrains(base, twin, kShift)).states);
  }
  return twins;
}

Curves CurvesOf(const Runs& runs, const std::string& observable) {
  Curves curves;
  for (const auto& states : runs) {
    auto& curve = curves.emplace_back();
    for (const State& state : states) curve.push_back(test::Observable(state, observable));
  }
  return curves;
}

// Standard deviation of each reading.
std::vector<double> ScatterOf(const Curves& curves) {
  std::vector<double> sd;
  for (std::size_t k = 0; k < curves.front().size(); ++k) {
    double sum = 0, squares = 0;
    for (const auto& curve : curves) sum += curve[k];
    const double n = static_cast<double>(curves.size()), mean = sum / n;
    for (const auto& curve : curves) squares += (curve[k] - mean) * (curve[k] - mean);
    sd.push_back(std::sqrt(squares / (n - 1)));
  }
  return sd;
}

// Root mean square over the later half of the path.
double Late(const std::vector<double>& sd) {
  double squares = 0;
  const std::size_t first = sd.size() / 2;
  for (std::size_t k = first; k < sd.size(); ++k) squares += sd[k] * sd[k];
  return std::sqrt(squares / static_cast<double>(sd.size() - first));
}

// Scatter of both kinds over the later half, parameters over grains.
double Ratio(const Twins& twins, const std::string& observable) {
  const Curves by_parameters = CurvesOf(twins.by_parameters, observable);
  const Curves by_grains = CurvesOf(twins.by_grains, observable);
  const std::vector<double> a = ScatterOf(by_parameters), b = ScatterOf(by_grains);
  const double size = *std::max_element(by_grains.front().begin(), by_grains.front().end());
  for (std::size_t k = 0; k < a.size(); ++k) {
    std::printf("%s, %4.1f %%: sd by parameters %.1e, by grains %.1e of the largest value\n",
                observable.c_str(), 0.5 * static_cast<double>(k + 1), a[k] / size, b[k] / size);
  }
  const double ratio = Late(a) / Late(b);
  std::printf("later half: parameters over grains %.2f\n", ratio);
  return ratio;
}

// Two sds of twelve runs differ by a factor of exp(sqrt(2 / 22)) = 1.35 by chance where the
// readings of a curve are one witness: three such factors.
TEST(Twins, ByParametersScatterLikeTwinsByGrains) {
  const Twins twins = Simulated({.grains = 200, .twins = 12, .readings = 12});
  const double ratio = Ratio(twins, "axial_stress");
  EXPECT_GT(ratio, 1 / 2.5);
  EXPECT_LT(ratio, 2.5);
}

TEST(TwinsSlow, ByParametersScatterLikeTwinsByGrains) {
  const Twins twins = Simulated({.grains = 1000, .twins = 24, .readings = 16});
  constexpr double kMost = 1.87;  // of 24 runs: exp(sqrt(2 / 46)) = 1.23, three such factors
  for (const char* observable : {"axial_stress", "volumetric_strain"}) {
    const double ratio = Ratio(twins, observable);
    EXPECT_GT(ratio, 1 / kMost) << observable;
    EXPECT_LT(ratio, kMost) << observable;
  }
}

}  // namespace
}  // namespace calib::dem
