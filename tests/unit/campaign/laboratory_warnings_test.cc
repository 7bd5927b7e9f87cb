// Readings that contradict their test, each other or the grains: warned of, or refused with a word
// for why.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "absl/strings/str_cat.h"
#include "server/campaign/checks/experiment_summary.h"
#include "tests/unit/campaign/laboratory.h"

namespace calib::campaign {
namespace {

using ::testing::DoubleNear;
using ::testing::HasSubstr;
using ::testing::Pointwise;

TEST(LaboratoryFiles, AStressThatContradictsTheTestsStartIsWarnedOf) {
  for (const auto& [name, file, units, factor] :
       {std::tuple("axial_stress", "0 200\n0.4 300\n0.8 350\n", "", "factor 1000"),
        std::tuple("axial_stress", "0 200\n0.4 300\n0.8 350\n", ", axial_stress: MPa",
                   "factor 0.001"),
        std::tuple("axial_stress", "0 50\n0.4 80\n0.8 95\n", ", axial_stress: kPa", "factor 4"),
        std::tuple("mean_stress", "0 0.2\n0.4 0.25\n0.8 0.27\n", "", "factor 1e+06"),
        std::tuple("stress_ratio", "0 0.01\n0.4 0.015\n0.8 0.017\n", "", "factor 100"),
        std::tuple("axial_stress", "0 29\n0.4 40\n0.8 45\n", "", "in psi"),
        std::tuple("void_ratio", "0 66\n0.4 66\n0.8 65\n", "", "refused")}) {
    const auto outcome =
        Read({.file = absl::StrCat("e x\n", file),
              .data = absl::StrCat("columns: {axial_strain: e, ", name,
                                   ": x}, strain: logarithmic, units: {axial_strain: percent",
                                   units, "}"),
              .observables = absl::StrCat("{", name, ": {noise: {relative: 0.03}}}")});
    if (std::string(factor) == "refused") {  // no void ratio at all
      EXPECT_THAT(ProblemsIn(outcome), HasSubstr("units: {void_ratio: percent}"));
      continue;
    }
    EXPECT_EQ(OnlyWarning(outcome), absl::StrCat("unit ", name));
    EXPECT_THAT(WarningsIn(outcome), HasSubstr(factor));
  }
}

TEST(LaboratoryFiles, AHeadingThatContradictsTheUnitIsWarnedOf) {
  const auto outcome = Read({.file = "e[%],s1[kPa]\n0,200\n0.4,300\n",
                             .data = "columns: {axial_strain: e, axial_stress: s1}, strain: "
                                     "logarithmic, units: {axial_stress: kPa}",
                             .observables = "{axial_stress: {noise: {relative: 0.03}}}"});
  EXPECT_EQ(OnlyWarning(outcome), "unit axial_strain");
  EXPECT_THAT(WarningsIn(outcome), HasSubstr("is headed '%' in d.csv"));
}

TEST(LaboratoryFiles, AStrainWithTheOtherSignIsWarnedOfAndTurned) {
  Laboratory lab{.file = "e q\n0 0\n-0.4 100\n-0.8 150\n-1.2 190\n",
                 .data =
                     "columns: {axial_strain: e, deviatoric_stress: q}, units: {axial_strain: "
                     "percent, deviatoric_stress: kPa}, strain: logarithmic",
                 .observables = "{deviatoric_stress: {noise: {absolute: 2 kPa}}}"};
  EXPECT_EQ(OnlyWarning(Read(lab)), "sign axial_strain");
  lab.data += ", sign: {axial_strain: -1}";
  const auto turned = Read(lab);
  EXPECT_EQ(ProblemsIn(turned) + WarningsIn(turned), "");
  EXPECT_THAT(turned.campaign.experiments[0].control,
              Pointwise(DoubleNear(1e-12), std::vector<double>{0, 0.004, 0.008, 0.012}));
  lab.data += ", sign: {axial_strain: 0}";
  EXPECT_FALSE(Read(lab).problems.empty());
}

// An extension test goes the other way with both.
TEST(LaboratoryFiles, AnExtensionTestIsNotWarnedOf) {
  const auto outcome = Read({.file = "e q\n0 0\n-0.4 -100\n-0.8 -110\n",
                             .data = "columns: {axial_strain: e, deviatoric_stress: q}, units: "
                                     "{axial_strain: percent, deviatoric_stress: kPa}",
                             .observables = "{deviatoric_stress: {noise: {absolute: 2 kPa}}}"});
  EXPECT_EQ(ProblemsIn(outcome) + WarningsIn(outcome), "");
}

TEST(LaboratoryFiles, AnOffsetOfTheFirstStrainIsNoUnloading) {
  Laboratory lab{
      .file = "axial_strain stress_ratio\n-0.01 0.98\n0.4 1.5\n0.8 1.75\n1.2 1.95\n1.6 2.05\n",
      .data = kPercent,
      .observables = kRatio};
  const auto outcome = Read(lab);
  EXPECT_EQ(OnlyWarning(outcome), "offset axial_strain");
  const Experiment& experiment = outcome.campaign.experiments[0];
  EXPECT_EQ(experiment.segment[1], "initial_loading");
  EXPECT_EQ(SummaryOf(experiment).turning_points, 0);
  EXPECT_EQ(experiment.path[0].target, 0);
  lab.data = absl::StrCat(kPercent, ", zero: first");
  EXPECT_EQ(WarningsIn(Read(lab)), "");
  EXPECT_NEAR(Read(lab).campaign.experiments[0].control[1], 0.0041, 1e-12);
  lab.data = absl::StrCat(kPercent, ", offset: {axial_strain: -0.01 percent}");
  EXPECT_EQ(WarningsIn(Read(lab)), "");
  EXPECT_NEAR(Read(lab).campaign.experiments[0].control[1], 0.0041, 1e-12);
}

// What the stresses say decides: at those of the start the strain is the gauge's, else it is
// pulled.
TEST(LaboratoryFiles, AFirstStrainWithTheStressesOfTheStartIsAnOffset) {
  const auto warned = [](const std::string& rows) {
    return OnlyWarning(Read({.file = "e q\n" + rows,
                             .data = "columns: {axial_strain: e, deviatoric_stress: q}, units: "
                                     "{axial_strain: percent, deviatoric_stress: kPa}, strain: "
                                     "logarithmic",
                             .observables = "{deviatoric_stress: {noise: {absolute: 2 kPa}}}"}));
  };
  EXPECT_EQ(warned("-0.5 0\n-0.1 100\n0.3 150\n0.7 190\n"), "offset axial_strain");
  EXPECT_EQ(warned("0.3 1\n0.7 100\n1.1 150\n1.5 190\n"), "offset axial_strain");
  EXPECT_EQ(warned("-0.05 -80\n0.4 100\n0.8 150\n1.2 190\n"), "");
  EXPECT_EQ(warned("0.3 90\n0.7 100\n1.1 150\n1.5 190\n"), "");
}

TEST(LaboratoryFiles, AVoidRatioIsNoPorosity) {
  const auto outcome = Read({.file = "e n\n0 0.66\n0.4 0.66\n0.8 0.65\n",
                             .data = "columns: {axial_strain: e, porosity: n}, units: "
                                     "{axial_strain: percent}",
                             .observables = "{porosity: {noise: {absolute: 0.002}}}"});
  EXPECT_EQ(OnlyWarning(outcome), "unit porosity");
}

TEST(LaboratoryFiles, AStrainFarBeyondTheOneThatDrivesItIsWarnedOf) {
  Laboratory lab{.file = "e v\n0 0\n0.4 0.12\n0.8 0.14\n",
                 .data =
                     "columns: {axial_strain: e, volumetric_strain: v}, units: {axial_strain: "
                     "percent}",
                 .observables = "{volumetric_strain: {noise: {absolute: 0.01}}}"};
  EXPECT_EQ(OnlyWarning(Read(lab)), "unit volumetric_strain");
  lab.file = "e v\n0 0\n0.4 0.0012\n0.8 -0.009\n";
  lab.observables = "{volumetric_strain: {noise: {absolute: 1e-4}}}";
  EXPECT_EQ(OnlyWarning(Read(lab)), "");
}

TEST(LaboratoryFiles, TensionPositiveIsSaidOnce) {
  const auto outcome = Read({.file = "e s\n0 -200\n0.4 -300\n0.8 -350\n",
                             .data = "columns: {axial_strain: e, axial_stress: s}, units: "
                                     "{axial_strain: percent, axial_stress: kPa}",
                             .observables = "{axial_stress: {noise: {relative: 0.03}}}"});
  EXPECT_EQ(OnlyWarning(outcome), "sign axial_stress");
}

TEST(LaboratoryFiles, NoiseThatSwallowsThePathIsRefused) {
  Laboratory lab{.file = "g t\n0 0\n0.05 20\n0 0\n-0.05 -20\n0 0\n0.05 20\n",
                 .data =
                     "columns: {shear_strain: g, shear_stress: t}, units: {shear_strain: "
                     "percent, shear_stress: kPa}",
                 .observables = "{shear_stress: {noise: {absolute: 2 kPa}}}",
                 .test = "simple_shear",
                 .settings = "confining_pressure: 100 kPa",
                 .control = "{column: shear_strain, noise: 0.003}"};
  const auto outcome = Read(lab);
  EXPECT_EQ(KindOfProblem(outcome), "control_noise");
  EXPECT_THAT(ProblemsIn(outcome), HasSubstr("0.3 percent"));
  lab.control = "{column: shear_strain, noise: 0.003 percent}";
  ASSERT_EQ(ProblemsIn(Read(lab)) + WarningsIn(Read(lab)), "");
  EXPECT_EQ(SummaryOf(Read(lab).campaign.experiments[0]).turning_points, 2);
}

TEST(LaboratoryFiles, AnErrorBeyondTheRangeOfItsReadingsIsWarnedOf) {
  const auto outcome = Read({.file = "axial_strain volumetric_strain stress_ratio\n0 0 1\n"
                                     "0.4 0.12 1.5\n0.8 0.14 1.7\n",
                             .data = "units: {axial_strain: percent, volumetric_strain: percent}",
                             .observables = "{volumetric_strain: {noise: {absolute: 0.06, "
                                            "correlation_length: 5}}, stress_ratio: {noise: "
                                            "{relative: 3}}}"});
  ASSERT_EQ(ProblemsIn(outcome), "");
  EXPECT_THAT(WarningsIn(outcome), HasSubstr("error_size tx, volumetric_strain: has a stated sd"));
  EXPECT_THAT(
      WarningsIn(outcome),
      HasSubstr("error_size tx, volumetric_strain: has a correlation_length of 500 percent"));
  EXPECT_THAT(WarningsIn(outcome), HasSubstr("error_size tx, stress_ratio: has a stated sd"));
  EXPECT_EQ(outcome.warnings.size(), 3U) << WarningsIn(outcome);
}

TEST(LaboratoryFiles, AnErrorIsComparedWithWhatItsReadingsSpan) {
  Laboratory curve{.file = "e q\n0 0\n0.4 100\n0.8 150\n1.2 190\n",
                   .data =
                       "columns: {axial_strain: e, deviatoric_stress: q}, units: "
                       "{axial_strain: percent, deviatoric_stress: kPa}",
                   .observables = "{deviatoric_stress: {noise: {relative: 3, floor: 1 kPa}}}"};
  EXPECT_EQ(OnlyWarning(Read(curve)), "error_size deviatoric_stress");
  curve.observables = "{deviatoric_stress: {noise: {relative: 0.5, floor: 1 kPa}}}";
  EXPECT_EQ(OnlyWarning(Read(curve)), "");
  // Repetitions scatter by less than their error: that is no curve without a range.
  Laboratory heap{.file = "rep aor\n1 29\n2 29.5\n3 30\n",
                  .data =
                      "columns: {repetition: rep, angle_of_repose: aor}, units: "
                      "{angle_of_repose: deg}",
                  .observables = "{angle_of_repose: {noise: {absolute: 2 deg}}}",
                  .test = "angle_of_repose",
                  .settings = "",
                  .control = "repetition",
                  .grains = "particles: 2000"};
  EXPECT_EQ(OnlyWarning(Read(heap)), "");
  heap.observables = "{angle_of_repose: {noise: {absolute: 2}}}";  // 115 deg
  EXPECT_EQ(OnlyWarning(Read(heap)), "error_size angle_of_repose");
}

TEST(LaboratoryFiles, WhatFollowsFromAnotherObservableIsWarnedOf) {
  const auto outcome = Read(
      {.file = "e r q s1 v n\n0 1 0 200 0 0.4\n0.4 1.5 100 300 0.2 0.4\n0.8 1.7 140 340 0.3 0.4\n",
       .data = "columns: {axial_strain: e, stress_ratio: r, deviatoric_stress: q, axial_stress: "
               "s1, volumetric_strain: v, porosity: n}, units: {axial_strain: percent, "
               "volumetric_strain: percent, deviatoric_stress: kPa, axial_stress: kPa}",
       .observables = "{stress_ratio: {noise: {absolute: 0.03}}, deviatoric_stress: {noise: "
                      "{absolute: 6 kPa}}, axial_stress: {noise: {absolute: 6 kPa}}, "
                      "volumetric_strain: {noise: {absolute: 0.1 percent}}, porosity: {noise: "
                      "{absolute: 1e-3}}}"});
  ASSERT_EQ(ProblemsIn(outcome), "");
  EXPECT_THAT(WarningsIn(outcome),
              HasSubstr("redundant tx, deviatoric_stress: follows from stress_ratio in"));
  EXPECT_THAT(WarningsIn(outcome),
              HasSubstr("redundant tx, axial_stress: follows from stress_ratio in"));
}

TEST(LaboratoryFiles, WhatTheTestHoldsIsRefused) {
  struct Held {
    const char* test;
    const char* observable;
    bool held;
  };
  for (const Held& c :
       {Held{"triaxial_drained", "lateral_stress", true},
        Held{"triaxial_undrained", "volumetric_strain", true},
        Held{"triaxial_undrained", "lateral_strain", true},
        Held{"oedometric", "lateral_strain", true}, Held{"oedometric", "volumetric_strain", true},
        Held{"oedometric", "void_ratio", false}, Held{"triaxial_undrained", "porosity", false},
        Held{"triaxial_drained", "volumetric_strain", false}}) {
    const auto outcome =
        Read({.file = "e x\n0 0.4\n0.01 0.41\n0.02 0.42\n",
              .data = absl::StrCat("columns: {axial_strain: e, ", c.observable, ": x}"),
              .observables = absl::StrCat("{", c.observable, ": {noise: {relative: 0.5}}}"),
              .test = c.test});
    EXPECT_EQ(KindOfProblem(outcome), c.held ? "held" : "") << c.test << " " << c.observable;
  }
}

TEST(LaboratoryFiles, AHeapOfFewGrainsIsWarnedOf) {
  Laboratory lab{.file = "rep aor\n1 29\n",
                 .data =
                     "columns: {repetition: rep, angle_of_repose: aor}, units: "
                     "{angle_of_repose: deg}",
                 .observables = "{angle_of_repose: {noise: {absolute: 2 deg}}}",
                 .test = "angle_of_repose",
                 .settings = "",
                 .control = "repetition",
                 .grains = "particles: 64"};
  EXPECT_EQ(OnlyWarning(Read(lab)), "few_grains angle_of_repose");
  lab.grains = "particles: 2000";
  EXPECT_EQ(ProblemsIn(Read(lab)) + WarningsIn(Read(lab)), "");
}

// A silo of 12 mean diameters is 24 mm wide, its smallest grain 1.6 mm thick.
TEST(LaboratoryFiles, AnOutletThatNoGrainPassesOrNoSiloHasIsRefused) {
  Laboratory lab{.file = "",
                 .data =
                     "columns: {opening: D, mass_flow_rate: W}, units: {opening: mm, "
                     "mass_flow_rate: g/s}",
                 .observables = "{mass_flow_rate: {noise: {relative: 0.1}}}",
                 .test = "silo_discharge",
                 .settings = "",
                 .control = "opening",
                 .grains = "particles: 150"};
  for (const auto& [opening, refused] :
       {std::pair("50", "opening 0.05 m is not smaller than silo_width, 0.02"),
        std::pair("1", "opening 0.001 m is not wider than the smallest grain, 0.0016"),
        std::pair("12000", "opening 12 m is not smaller than silo_width, 0.02"),
        std::pair("12", "")}) {
    lab.file = absl::StrCat("D W\n", opening, " 10\n");
    const auto outcome = Read(lab);
    EXPECT_EQ(KindOfProblem(outcome), *refused == '\0' ? "" : "impossible") << opening;
    EXPECT_THAT(ProblemsIn(outcome), HasSubstr(refused)) << opening;
  }
}

// Weights are put on and taken off: the stress is what is known, settlements are read.
TEST(LaboratoryFiles, AStressDrivesAnOedometer) {
  Laboratory lab{.file = "s e\n50 0.70\n100 0.69\n200 0.67\n400 0.64\n100 0.65\n50 0.655\n",
                 .data = "columns: {axial_stress: s, void_ratio: e}, units: {axial_stress: kPa}",
                 .observables = "{void_ratio: {noise: {absolute: 0.005}}}",
                 .test = "oedometric",
                 .settings = "confining_pressure: 50 kPa",
                 .control = "axial_stress"};
  const auto outcome = Read(lab);
  ASSERT_EQ(ProblemsIn(outcome) + WarningsIn(outcome), "");
  const Experiment& experiment = outcome.campaign.experiments[0];
  EXPECT_EQ(experiment.settings.at(dem::kStressDriven), 1);
  EXPECT_EQ(experiment.control_start, 50e3);
  EXPECT_EQ(SummaryOf(experiment).turning_points, 1);
  EXPECT_NEAR(experiment.path.back().target, 50e3, 1e-9);
  lab.data = "columns: {axial_stress: s, void_ratio: e}";  // the unit forgotten
  EXPECT_EQ(OnlyWarning(Read(lab)), "unit axial_stress");
  lab.settings += "\n    stress_driven: 1";
  EXPECT_THAT(ProblemsIn(Read(lab)), HasSubstr("follows from the control"));
  lab.settings = "confining_pressure: 50 kPa";
  lab.test = "triaxial_drained";
  EXPECT_THAT(ProblemsIn(Read(lab)), HasSubstr("'axial_stress' cannot drive triaxial_drained"));
}

// What is held and what drives change places with the control.
TEST(LaboratoryFiles, AnOedometerDrivenByStressHoldsItsStress) {
  for (const auto& [observable, held] :
       {std::pair("lateral_strain", true), std::pair("axial_strain", false),
        std::pair("volumetric_strain", false), std::pair("lateral_stress", false)}) {
    const auto outcome =
        Read({.file = "s x\n200000 0\n300000 0.01\n400000 0.02\n",
              .data = absl::StrCat("columns: {axial_stress: s, ", observable, ": x}"),
              .observables = absl::StrCat("{", observable, ": {noise: {absolute: 1e-2}}}"),
              .test = "oedometric",
              .control = "axial_stress"});
    EXPECT_EQ(KindOfProblem(outcome), held ? "held" : "") << observable;
  }
}

TEST(LaboratoryFiles, RowsInDisorderAreWarnedOf) {
  const auto shuffled = Read({.file = "axial_strain stress_ratio\n0 1\n3 2\n0.5 1.5\n4 2.2\n1 1.8\n"
                                      "5 2.3\n2 1.9\n",
                              .data = kPercent,
                              .observables = kRatio});
  EXPECT_THAT(WarningsIn(shuffled), HasSubstr("path_order tx, axial_strain: turns back at"));
  const auto reversed =
      Read({.file = "axial_strain stress_ratio\n4 2.5\n3 2.4\n2 2.2\n1 1.8\n0.5 1.6\n0 1\n",
            .data = kPercent,
            .observables = kRatio});
  EXPECT_THAT(WarningsIn(reversed), HasSubstr("path_order tx, axial_strain: begins at 4 percent"));
}

}  // namespace
}  // namespace calib::campaign
