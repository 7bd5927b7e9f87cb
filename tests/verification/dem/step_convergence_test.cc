// A drained triaxial test must not depend on the time step or the rate: mean curves of repeats at
// several shares of the critical step and several rates, a small specimen in the suite and the
// published one by hand (suite ...Slow).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "dem/dynamics/quasi_static.h"
#include "dem/registry/registry.h"
#include "tests/support/dem/yade_cases.h"

namespace calib::dem {
namespace {

constexpr double kPressure = 5e5;

struct Walk {
  double share = 0.9;   ///< time step over the largest stable one
  double rate = 0.1;    ///< of density scaled by a thousand [1/s]
  double stage = 2e-3;  ///< axial strain between two settlings
};

struct Curve {
  std::vector<double> ratio, volume;  ///< stress ratio and volumetric strain at each per cent
  double scatter = 0;  ///< of one run: rms standard deviation of the ratio over its largest mean
  double volume_scatter = 0;
  double steps = 0;
};

/// One repeat to `strain`: consolidates, then strains the axis in stages at constant lateral
/// stress.
Curve Run(const Packing& packing, const Model& model, const Walk& walk, double strain) {
  Assembly assembly(packing, model.density, ContactModelOf(model), 1);
  QuasiStatic stages(assembly, {.rate = walk.rate, .step_share = walk.share}, {});
  const AxisTarget held{.mode = AxisTarget::Mode::kStress, .value = kPressure};
  for (const double part : {0.1, 0.2, 0.5, 1.0}) {
    const AxisTarget some{.mode = AxisTarget::Mode::kStress, .value = part * kPressure};
    EXPECT_EQ(stages.MoveTo({{some, some, some}}), StageEnd::kDone) << stages.reason();
  }
  const double length = assembly.cell().length[2];
  const double volume = assembly.cell().Volume();
  Curve curve;
  const int last = static_cast<int>(std::lround(strain / walk.stage));
  const int each = static_cast<int>(std::lround(0.01 / walk.stage));
  for (int k = 0; k <= last; ++k) {
    const AxisTarget driven{.mode = AxisTarget::Mode::kLength,
                            .value = length * std::exp(-walk.stage * k)};
    EXPECT_EQ(stages.MoveTo({{held, held, driven}}), StageEnd::kDone) << stages.reason();
    if (k % each == 0) {
      const auto& s = assembly.stress();
      curve.ratio.push_back(2 * s[2] / (s[0] + s[1]));
      curve.volume.push_back(std::log(volume / assembly.cell().Volume()));
    }
  }
  curve.steps = static_cast<double>(assembly.steps());
  return curve;
}

Curve Mean(const Packing& packing, const Model& model, const Walk& walk, double strain,
           int repeats) {
  std::vector<Curve> runs;
  for (int r = 0; r < repeats; ++r) {
    Scenario shifted;
    shifted.packing = packing;
    runs.push_back(Run(test::Perturbed(shifted, r).packing, model, walk, strain));
  }
  Curve mean;
  double ratio2 = 0;
  double volume2 = 0;
  const std::size_t points = runs[0].ratio.size();
  for (std::size_t k = 0; k < points; ++k) {
    double ratio = 0;
    double volume = 0;
    for (const Curve& run : runs) {
      ratio += run.ratio[k] / repeats;
      volume += run.volume[k] / repeats;
    }
    for (const Curve& run : runs) {
      ratio2 += std::pow(run.ratio[k] - ratio, 2) / (repeats - 1);
      volume2 += std::pow(run.volume[k] - volume, 2) / (repeats - 1);
    }
    mean.ratio.push_back(ratio);
    mean.volume.push_back(volume);
  }
  const double largest = *std::max_element(mean.ratio.begin(), mean.ratio.end());
  mean.scatter = std::sqrt(ratio2 / static_cast<double>(points)) / largest;
  mean.volume_scatter = std::sqrt(volume2 / static_cast<double>(points));
  mean.steps = runs[0].steps;
  return mean;
}

double Rms(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    sum += (a[k] - b[k]) * (a[k] - b[k]);
  }
  return std::sqrt(sum / static_cast<double>(a.size()));
}

struct Shift {
  double ratio = 0, volume = 0;  ///< rms, the ratio's over its largest value
};

/// Prints how far each way's mean curve lies from the first one's.
std::vector<Shift> Compare(const std::vector<Curve>& curves,
                           const std::vector<std::string>& names) {
  const double largest = *std::max_element(curves[0].ratio.begin(), curves[0].ratio.end());
  std::vector<Shift> shifts;
  for (std::size_t k = 0; k < curves.size(); ++k) {
    shifts.push_back({.ratio = Rms(curves[k].ratio, curves[0].ratio) / largest,
                      .volume = Rms(curves[k].volume, curves[0].volume)});
    std::printf(
        "%s: stress ratio %.2f %%, volumetric strain %.1e from the first; one run scatters "
        "%.2f %%, %.1e; %.0f steps\n",
        names[k].c_str(), 100 * shifts[k].ratio, shifts[k].volume, 100 * curves[k].scatter,
        curves[k].volume_scatter, curves[k].steps);
  }
  return shifts;
}

// Two means of four lie sqrt(2/4) of the scatter of one run apart by chance; three times that is
// allowed, beside 1 % of the ratio and 1e-3 of strain.
TEST(StepConvergence, HalvedStepsAndRatesGiveTheSameCurve) {
  constexpr int kRepeats = 4;
  const Packing& packing = test::SmallPacking(200);
  const Model model = test::HertzModel();
  std::vector<Curve> curves;
  for (const Walk& walk :
       {Walk{.share = 0.45}, Walk{}, Walk{.rate = 0.05}, Walk{.rate = 0.2}, Walk{.stage = 1e-3}}) {
    curves.push_back(Mean(packing, model, walk, 0.05, kRepeats));
  }
  const auto shifts = Compare(
      curves, {"half the step", "as it is", "half the rate", "twice the rate", "half the stage"});
  for (std::size_t k = 1; k < curves.size(); ++k) {
    const double chance = 3 * std::sqrt(2.0 / kRepeats);
    EXPECT_LT(shifts[k].ratio, 0.01 + chance * curves[0].scatter) << k;
    EXPECT_LT(shifts[k].volume, 1e-3 + chance * curves[0].volume_scatter) << k;
  }
}

// The published packing of 1000 grains, base case; needs CALIB_DATA.
TEST(StepConvergenceSlow, PublishedPacking) {
  if (test::DataFolder().empty()) {
    GTEST_SKIP() << "CALIB_DATA is not set";
  }
  constexpr int kRepeats = 4;
  const Packing packing =
      test::LoadPacking(test::DataFolder() + "/toyoura_triaxial/packing_1000.txt");
  std::vector<Curve> curves;
  std::vector<std::string> names;
  for (const double share : {0.225, 0.45, 0.9}) {
    curves.push_back(Mean(packing, test::CaseModel("base"), {.share = share}, 0.08, kRepeats));
    names.push_back("step " + std::to_string(share));
  }
  const auto shifts = Compare(curves, names);
  for (std::size_t k = 1; k < curves.size(); ++k) {
    EXPECT_LT(shifts[k].ratio, 0.01);
    EXPECT_LT(shifts[k].volume, 5e-4);
  }
}

}  // namespace
}  // namespace calib::dem
