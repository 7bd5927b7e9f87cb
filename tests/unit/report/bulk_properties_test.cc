// Bulk properties of a drained triaxial curve that is known: elastic to 2 % axial strain (secant
// modulus 20 MPa, Poisson's ratio 0.3), peak stress ratio 4 at 5 %, critical state 3 from 12 % on.

#include "server/report/views/bulk_properties.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace calib::report {
namespace {

constexpr double kPressure = 0.2e6;

double StressRatio(double strain) {
  if (strain <= 0.02) return 1 + 20e6 * strain / kPressure;
  if (strain <= 0.05) return 3 + (strain - 0.02) / 0.03;
  if (strain <= 0.12) return 4 - (strain - 0.05) / 0.07;
  return 3;
}

double VolumetricStrain(double strain) {
  return strain <= 0.02 ? 0.4 * strain : 0.008 - 0.3 * (strain - 0.02);
}

enum class Reported { kStrainAndStress, kRatioOfInvariants };

struct KnownRun {
  campaign::Experiment experiment;
  StateHistory history;

  explicit KnownRun(Reported reported) {
    experiment.test = "triaxial_drained";
    experiment.settings["confining_pressure"] = kPressure;
    experiment.control_name = "axial_strain";
    history.observables = reported == Reported::kStrainAndStress
                              ? std::vector<std::string>{"axial_strain", "volumetric_strain",
                                                         "deviatoric_stress", "stress_ratio"}
                              : std::vector<std::string>{"volumetric_strain", "q_over_p"};
    // No reading at the deviatoric strain of 1 %, which is at 1.154 % axial strain.
    for (int step = 0; step <= 50; ++step) Add(reported, step * 0.003, StressRatio(step * 0.003));
    Add(reported, 0.145, 9);  // unloading, which is not read
  }

  void Add(Reported reported, double strain, double ratio) {
    v1::State& state = history.states.emplace_back();
    state.set_load_step(static_cast<int>(experiment.control.size()));
    experiment.control.push_back(strain);
    if (reported == Reported::kStrainAndStress) {
      for (const double value :
           {strain, VolumetricStrain(strain), (ratio - 1) * kPressure, ratio}) {
        state.add_values(value);
      }
    } else {
      state.add_values(VolumetricStrain(strain));
      state.add_values(3 * (ratio - 1) / (ratio + 2));
    }
  }
};

TEST(BulkProperties, OfAKnownCurve) {
  for (const Reported reported : {Reported::kStrainAndStress, Reported::kRatioOfInvariants}) {
    const KnownRun run(reported);
    const std::vector<BulkProperty> found = BulkProperties(run.experiment, run.history);
    ASSERT_EQ(found.size(), 4u);
    EXPECT_EQ(found[0].name, "secant_modulus");
    EXPECT_NEAR(found[0].value, 20e6, 1);
    EXPECT_EQ(found[1].name, "secant_poisson_ratio");
    EXPECT_NEAR(found[1].value, 0.3, 1e-9);
    // No reading at 5 % sharp: the largest ratio is that at 5.1 %, 4 - 0.001 / 0.07.
    const double peak = StressRatio(0.051);
    EXPECT_EQ(found[2].name, "peak_friction_angle");
    EXPECT_NEAR(found[2].value, std::asin((peak - 1) / (peak + 1)), 1e-9);
    EXPECT_EQ(found[3].name, "critical_friction_angle");
    EXPECT_NEAR(found[3].value, std::numbers::pi / 6, 1e-9);  // asin(2 / 4)
  }
}

TEST(BulkProperties, OfACurveThatEndsBeforeOnePercent) {
  KnownRun run(Reported::kStrainAndStress);
  run.history.states.resize(3);
  const std::vector<BulkProperty> found = BulkProperties(run.experiment, run.history);
  ASSERT_EQ(found.size(), 4u);
  EXPECT_TRUE(std::isnan(found[0].value));
  EXPECT_TRUE(std::isnan(found[1].value));
  EXPECT_GT(found[2].value, 0);
}

TEST(BulkProperties, OfAnotherTestAreNone) {
  KnownRun run(Reported::kStrainAndStress);
  run.experiment.test = "oedometric";
  EXPECT_TRUE(BulkProperties(run.experiment, run.history).empty());
}

// Where a curve does not tell, the observable that is missing is named.
TEST(BulkProperties, SaysWhichObservableIsMissing) {
  KnownRun known(Reported::kRatioOfInvariants);
  const auto why = [&known](const char* name) {
    return WhyNoBulkProperty(known.experiment, known.history, name);
  };
  known.history.observables[0] = "void_ratio";
  EXPECT_EQ(why("secant_modulus"), "no volumetric_strain is among its observables");
  EXPECT_EQ(why("secant_poisson_ratio"), "no volumetric_strain is among its observables");
  known.history.observables = {"volumetric_strain", "porosity"};
  for (const char* name : {"secant_modulus", "peak_friction_angle", "critical_friction_angle"}) {
    EXPECT_EQ(why(name),
              "none of deviatoric_stress, stress_ratio and q_over_p is among its observables");
  }
  known.experiment.control_name = "deviatoric_strain";
  EXPECT_EQ(why("critical_friction_angle"), "no axial_strain is among its observables");

  KnownRun brief(Reported::kStrainAndStress);
  brief.history.states.resize(3);
  EXPECT_TRUE(std::isnan(BulkProperties(brief.experiment, brief.history)[0].value));
  EXPECT_EQ(WhyNoBulkProperty(brief.experiment, brief.history, "secant_modulus"),
            "no run reaches a deviatoric strain of 1 %");
}

}  // namespace
}  // namespace calib::report
