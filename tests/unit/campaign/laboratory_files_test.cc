// Files as laboratories write them, with what a careful reader would make of each: read right,
// warned of, or refused with a word for why.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "absl/strings/str_cat.h"
#include "server/campaign/checks/experiment_summary.h"
#include "tests/unit/campaign/good_campaign.h"

namespace calib::campaign {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pointwise;
using testing::ReaderOf;

// What varies between the files here; the rest is a small drained test of 64 grains.
struct Laboratory {
  std::string file = "";
  std::string data = "";         // keys of `data` beside the file
  std::string observables = "";  // a map
  std::string test = "triaxial_drained";
  std::string settings = "confining_pressure: 200 kPa";
  std::string control = "axial_strain";
  std::string grains = "particles: 64, porosity: 0.40, radii: {mean: 1.5 mm, spread: 0.3}, seed: 1";
};

ReadOutcome Read(const Laboratory& lab, CampaignIs is = CampaignIs::kNew) {
  const bool poured = lab.test == "angle_of_repose" || lab.test == "silo_discharge";
  const std::string yaml = absl::StrCat(
      "name: a\nmodel:\n  contact: hertz_mindlin\n  density: 2600 kg/m^3\n",
      "  effects: [rolling_resistance, viscous_damping]\n",
      "  fixed: {poisson_ratio: 0.2, young_modulus: 5 MPa, rolling_resistance.stiffness: 0.5, ",
      "rolling_resistance.friction: 0.1, viscous_damping.ratio: 0.3}\n",
      "parameters: {friction_coefficient: {prior: uniform, min: 0.2, max: 0.8}}\n",
      "experiments:\n  - name: tx\n    test: ", lab.test, "\n",
      lab.settings.empty() ? "" : "    " + lab.settings + "\n", "    packing: {generate: {",
      poured ? "diameters: {mean: 2 mm, spread: 0.2}, seed: 1, " : "", lab.grains, "}}\n",
      "    data: {file: d.csv, ", lab.data, "}\n    control: ", lab.control,
      "\n    observables: ", lab.observables, "\n",
      "noise: given\ninference: {method: sqmc, samples: 4}\nseed: 7\n");
  return ReadCampaign(yaml, "c.yaml", ReaderOf({{"d.csv", lab.file}}), std::nullopt, is);
}

std::string ProblemsIn(const ReadOutcome& outcome) {
  std::string text;
  for (const Problem& problem : outcome.problems) text += ToString(problem) + "\n";
  return text;
}

std::string WarningsIn(const ReadOutcome& outcome) {
  std::string text;
  for (const Warning& warning : outcome.warnings) {
    absl::StrAppend(&text, WordOf(kWarningKindWords, warning.kind), " ", Sentence(warning), "\n");
  }
  return text;
}

// Kind and name of the only warning; all of them otherwise.
std::string OnlyWarning(const ReadOutcome& outcome) {
  if (!outcome.problems.empty()) return ProblemsIn(outcome);
  if (outcome.warnings.size() != 1) return WarningsIn(outcome);
  return absl::StrCat(WordOf(kWarningKindWords, outcome.warnings[0].kind), " ",
                      outcome.warnings[0].name);
}

std::string KindOfProblem(const ReadOutcome& outcome) {
  return outcome.problems.size() == 1 ? outcome.problems[0].kind : ProblemsIn(outcome);
}

const MeasuredObservable& First(const ReadOutcome& outcome) {
  return outcome.campaign.experiments.at(0).observables.at(0);
}

constexpr const char* kPercent = "units: {axial_strain: percent}, strain: logarithmic";
constexpr const char* kRatio = "{stress_ratio: {noise: {relative: 0.03}}}";

TEST(LaboratoryFiles, UnitsInAHeaderShiftNoColumn) {
  const auto outcome = Read({.file = "# e (%) q (kPa) u (kPa)\n0 1 10\n0.4 50 20\n0.8 75 30\n",
                             .data = "columns: {axial_strain: e, deviatoric_stress: q}, units: "
                                     "{axial_strain: percent, deviatoric_stress: kPa}, strain: "
                                     "logarithmic",
                             .observables = "{deviatoric_stress: {noise: {absolute: 2 kPa}}}"});
  EXPECT_EQ(ProblemsIn(outcome) + WarningsIn(outcome), "");
  EXPECT_THAT(First(outcome).values,
              Pointwise(DoubleNear(1e-9), std::vector<double>{1e3, 50e3, 75e3}));
}

TEST(LaboratoryFiles, ABlankInANameShiftsNoColumn) {
  const auto outcome = Read({.file = "eps1  epsv  Void ratio   q    p\n0\t0\t0.90\t1\t100\n"
                                     "0.4\t0.2\t0.89\t50\t117\n0.8\t0.3\t0.88\t75\t125\n",
                             .data = "columns: {axial_strain: eps1, deviatoric_stress: q, "
                                     "void_ratio: Void ratio}, units: {axial_strain: percent, "
                                     "deviatoric_stress: kPa}, strain: logarithmic",
                             .observables = "{deviatoric_stress: {noise: {absolute: 2 kPa}}, "
                                            "void_ratio: {noise: {absolute: 0.01}}}"});
  EXPECT_EQ(ProblemsIn(outcome) + WarningsIn(outcome), "");
  EXPECT_THAT(First(outcome).values,
              Pointwise(DoubleNear(1e-9), std::vector<double>{1e3, 50e3, 75e3}));
  EXPECT_THAT(outcome.campaign.experiments[0].observables[1].values, ElementsAre(0.90, 0.89, 0.88));
}

TEST(LaboratoryFiles, QuotedNumbersAreNumbers) {
  const auto outcome = Read({.file = "\"axial_strain\",\"stress_ratio\"\n\"0.0\",\"1.0\"\n"
                                     "\"0.4\",\"1.5\"\n\"0.8\",\"1.7\"\n",
                             .data = kPercent,
                             .observables = kRatio});
  EXPECT_EQ(ProblemsIn(outcome) + WarningsIn(outcome), "");
  EXPECT_THAT(First(outcome).values, ElementsAre(1, 1.5, 1.7));
}

TEST(LaboratoryFiles, AMissingReadingIsLeftOutAndItsRowStays) {
  const auto outcome = Read({.file = "axial_strain,volumetric_strain,stress_ratio\n0,0,1\n"
                                     "0.4,NaN,1.5\n0.8,0.4,1.7\n,0.5,1.8\n1.2,,-\n",
                             .data = "units: {axial_strain: percent, volumetric_strain: percent}, "
                                     "strain: logarithmic, missing: ['-']",
                             .observables = "{stress_ratio: {noise: {relative: 0.03}}, "
                                            "volumetric_strain: {noise: {absolute: 0.06 percent, "
                                            "correlation_length: 0.5 percent}}}"});
  ASSERT_EQ(ProblemsIn(outcome) + WarningsIn(outcome), "");
  const Experiment& experiment = outcome.campaign.experiments[0];
  EXPECT_EQ(experiment.path.size(), 4U);
  const ExperimentSummary summary = SummaryOf(experiment);
  EXPECT_EQ(summary.observables[0].readings, 3);
  EXPECT_EQ(summary.observables[0].missing, 2);  // one of them without its control
  EXPECT_EQ(summary.observables[1].readings, 2);
  EXPECT_EQ(summary.observables[1].missing, 3);
  const inference::DataSet data = MakeDataSet(outcome.campaign);
  ASSERT_EQ(data.readings.size(), 5U);
  EXPECT_EQ(data.readings[2].load_step, 1);
  EXPECT_EQ(data.readings[2].value, 1.5);
  EXPECT_EQ(data.readings[3].load_step, 2);
  EXPECT_TRUE(inference::ValidateData(data, inference::NoiseMode::kGiven).ok());
}

TEST(LaboratoryFiles, ACovarianceIsOfTheReadingsThatThereAre) {
  Laboratory lab{.file = "axial_strain,stress_ratio\n0,1\n0.4,\n0.8,1.7\n",
                 .data = kPercent,
                 .observables = "{stress_ratio: {noise: {covariance: cov.txt}}}"};
  const auto outcome = Read(lab);
  EXPECT_THAT(ProblemsIn(outcome), HasSubstr("cannot read 'cov.txt'"));
}

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

TEST(LaboratoryFiles, ANumberMayStandForNoReading) {
  Laboratory lab{.file = "axial_strain,stress_ratio\n0,1\n0.4,-999.0\n0.8,1.7\n",
                 .data = absl::StrCat(kPercent, ", missing: [-999]"),
                 .observables = kRatio};
  const auto outcome = Read(lab);
  EXPECT_EQ(ProblemsIn(outcome) + WarningsIn(outcome), "");
  EXPECT_TRUE(std::isnan(First(outcome).values.at(1)));
  lab.data = kPercent;
  lab.file = "axial_strain,stress_ratio\n0,1\n0.4,-\n0.8,1.7\n";
  EXPECT_THAT(ProblemsIn(Read(lab)), HasSubstr("d.csv:3: stress_ratio: '-' is not a number; if "
                                               "nothing was measured there, say so: missing: "
                                               "['-']"));
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

TEST(LaboratoryFiles, UnitsOfOtherCountriesAreRead) {
  struct Stress {
    const char* unit;
    const char* reading;
    double pascal;
  };
  for (const Stress& c : {Stress{"psi", "29.0075", 200e3}, Stress{"ksf", "4.1771", 200e3},
                          Stress{"kgf/cm^2", "2.03943", 200e3}, Stress{"kgf/cm2", "2.03943", 200e3},
                          Stress{"bar", "2", 200e3}}) {
    const auto outcome =
        Read({.file = absl::StrCat("axial_strain s\n0 ", c.reading, "\n0.4 ", c.reading, "\n0.8 ",
                                   c.reading, "\n"),
              .data = absl::StrCat("columns: {axial_stress: s}, strain: logarithmic, units: "
                                   "{axial_strain: percent, axial_stress: ",
                                   c.unit, "}"),
              .observables = "{axial_stress: {noise: {relative: 0.03}}}"});
    EXPECT_EQ(ProblemsIn(outcome) + WarningsIn(outcome), "") << c.unit;
    EXPECT_NEAR(First(outcome).values.at(0), c.pascal, 5) << c.unit;
  }
}

TEST(LaboratoryFiles, ASheetIsOfAWorkbookWhichIsNamed) {
  Laboratory lab{.file = "axial_strain stress_ratio\n0 1\n0.4 1.5\n",
                 .data = absl::StrCat(kPercent, ", sheet: TMD1"),
                 .observables = kRatio};
  EXPECT_THAT(ProblemsIn(Read(lab)), HasSubstr("d.csv is a text, which holds one table"));
  lab.file = "PK\x03\x04 and so on";
  EXPECT_EQ(KindOfProblem(Read(lab)), "encoding");
  EXPECT_THAT(ProblemsIn(Read(lab)), HasSubstr("save its sheet as CSV"));
}

// A campaign means later what it meant when it was submitted: by today's rules, or by those of its
// time.
TEST(LaboratoryFiles, AStoredCampaignIsReadByTheRulesOfItsTime) {
  const Laboratory shifted{.file = "# e (%) q (kPa) u (kPa)\n0 1 10\n0.4 50 20\n0.8 75 30\n",
                           .data =
                               "columns: {axial_strain: e, deviatoric_stress: q}, units: "
                               "{axial_strain: percent, deviatoric_stress: kPa}, strain: "
                               "logarithmic",
                           .observables = "{deviatoric_stress: {noise: {absolute: 2 kPa}}}"};
  const std::vector<double> right = {1e3, 50e3, 75e3};
  const std::vector<double> as_once = {10e3, 20e3, 30e3};
  EXPECT_THAT(First(Read(shifted, CampaignIs::kStored)).values, Pointwise(DoubleNear(1e-9), right));
  EXPECT_THAT(First(Read(shifted, CampaignIs::kStoredByFirstRules)).values,
              Pointwise(DoubleNear(1e-9), as_once));
  const Laboratory offset{
      .file = "axial_strain stress_ratio\n-0.01 0.98\n0.4 1.5\n0.8 1.75\n1.2 1.95\n1.6 2.05\n",
      .data = kPercent,
      .observables = kRatio};
  const auto segment = [&offset](CampaignIs is) {
    return Read(offset, is).campaign.experiments.at(0).segment.at(1);
  };
  EXPECT_EQ(segment(CampaignIs::kStored), "initial_loading");
  EXPECT_EQ(segment(CampaignIs::kStoredByFirstRules), "unload_1");
  EXPECT_EQ(StoredUnder(kReadingRules), CampaignIs::kStored);
  EXPECT_EQ(StoredUnder(1), CampaignIs::kStoredByFirstRules);
}

TEST(LaboratoryFiles, FormulasMakeColumnsOfColumns) {
  Laboratory lab{
      .file = "eps (%),s1,s3,\"u, kPa\"\n0,200,200,1\n0.4,300,200,2\n0.8,,200,3\n1.2,390,198,4\n",
      .data =
          "columns: {axial_strain: eps, deviatoric_stress: q, mean_stress: p}, units: "
          "{axial_strain: percent, deviatoric_stress: kPa, mean_stress: kPa}, formulas: {q: s1 "
          "- s3, p: \"($2 + 2*$3)/3\"}, strain: logarithmic",
      .observables = "{deviatoric_stress: {noise: {absolute: 2 kPa}}}"};
  const auto outcome = Read(lab);
  ASSERT_EQ(ProblemsIn(outcome) + WarningsIn(outcome), "");
  EXPECT_THAT(First(outcome).values[1], DoubleNear(100e3, 1e-6));
  EXPECT_TRUE(std::isnan(First(outcome).values[2]));
  EXPECT_THAT(First(outcome).values[3], DoubleNear(192e3, 1e-6));
  for (const auto& [formula, problem] :
       {std::pair("q: s1 - s9", "'s9'"), std::pair("q: s1 -", "formulas.q"),
        std::pair("s1: 2 * s3", "is a column of d.csv already"),
        std::pair("q: 1/(s1 - 200)", "d.csv:2: q: the formula gives no finite number here")}) {
    lab.data = absl::StrCat("columns: {axial_strain: eps, deviatoric_stress: q}, formulas: {",
                            formula, "}");
    EXPECT_THAT(ProblemsIn(Read(lab)), HasSubstr(problem)) << formula;
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

TEST(LaboratoryFiles, FormatKeysAreChecked) {
  for (const auto& [keys, problem] :
       {std::pair("separator: x", "'x' is none of"), std::pair("decimal: dot", "decimal"),
        std::pair("skip: -1", "skip"), std::pair("rows: 5-3", "is no range of rows"),
        std::pair("rows: 3-40", "has 2 rows; rows names others"),
        std::pair("header: two", "header"),
        std::pair("zero: axial", "is neither an observable nor 'first'"),
        std::pair("sign: {axial: -1}", "is not an observable"),
        std::pair("offset: {axial_strain: 1 kPa}", "is a pressure"),
        std::pair("where: {id: T1}", "holds no rows of numbers with id T1")}) {
    const auto outcome = Read({.file = "axial_strain stress_ratio\n0 1\n0.01 1.5\n",
                               .data = keys,
                               .observables = kRatio});
    ASSERT_EQ(outcome.problems.size(), 1U) << keys << "\n" << ProblemsIn(outcome);
    EXPECT_THAT(ProblemsIn(outcome), HasSubstr(problem)) << keys;
  }
}

// Four readings at 0, 1, 2, 3 %, and two runs that go on at other strains.
ReadOutcome ReadRuns(const std::string& states, CampaignIs is = CampaignIs::kNew) {
  return ReadCampaign(
      "name: a\nmodel:\n  precomputed:\n    parameters: p.csv\n    states: s.csv\n"
      "    state_units: {mean_stress: MPa}\n"
      "parameters: {stiff: {prior: uniform, min: 0, max: 200, unit: 1}}\n"
      "experiments:\n  - name: oedo\n    test: oedometric\n    confining_pressure: 1 MPa\n"
      "    data: {file: d.csv, units: {mean_stress: MPa}, strain: logarithmic}\n"
      "    control: axial_strain\n    observables: {mean_stress: {noise: {relative: 0.05}}}\n"
      "noise: given\ninference: {method: sqmc}\nseed: 7\n",
      "c.yaml",
      ReaderOf({{"d.csv", "axial_strain,mean_stress\n0.0,1.0\n0.01,1.3\n0.02,1.9\n0.03,2.4\n"},
                {"p.csv", "sample,stiff\n0,10\n1,20\n"},
                {"s.csv", "sample,step,axial_strain,mean_stress\n" + states}}),
      std::nullopt, is);
}

TEST(LaboratoryFiles, RunsAtOtherStrainsAreInterpolatedOrRefused) {
  const auto within = ReadRuns(
      "0,0,0,1\n0,1,0.02,2\n0,2,0.04,4\n0,3,0.06,6\n1,0,0,1\n1,1,0.02,3\n1,2,0.04,5\n1,3,0.06,7\n");
  ASSERT_EQ(ProblemsIn(within), "");
  const auto& values = within.campaign.precomputed->values.at(0);
  EXPECT_THAT(values[0], Pointwise(DoubleNear(1e-3), std::vector<double>{1e6, 1.5e6, 2e6, 3e6}));
  EXPECT_THAT(values[1], Pointwise(DoubleNear(1e-3), std::vector<double>{1e6, 2e6, 3e6, 4e6}));
  const auto as_once = ReadRuns(
      "0,0,0,1\n0,1,0.02,2\n0,2,0.04,4\n0,3,0.06,6\n1,0,0,1\n1,1,0.02,3\n1,2,0.04,5\n1,3,0.06,7\n",
      CampaignIs::kStoredByFirstRules);
  EXPECT_THAT(as_once.campaign.precomputed->values.at(0)[0], ElementsAre(1e6, 2e6, 4e6, 6e6));
  const auto same = ReadRuns(
      "0,0,0,1\n0,1,0.01,2\n0,2,0.02,4\n0,3,0.03,6\n1,0,0,1\n1,1,0.01,3\n1,2,0.02,5\n1,3,0.03,7\n");
  EXPECT_THAT(same.campaign.precomputed->values.at(0)[0], ElementsAre(1e6, 2e6, 4e6, 6e6));
  const auto short_of = ReadRuns(
      "0,0,0,1\n0,1,0.005,2\n0,2,0.01,4\n0,3,0.015,6\n"
      "1,0,0,1\n1,1,0.005,3\n1,2,0.01,5\n1,3,0.015,7\n");
  EXPECT_EQ(KindOfProblem(short_of), "control_mismatch");
  EXPECT_THAT(ProblemsIn(short_of), HasSubstr("the runs go from 0 percent to 1.5 percent"));
  const auto twice = ReadRuns("0,0,0,1\n0,1,0.02,2\n0,1,0.04,4\n0,3,0.06,6\n1,0,0,1\n1,1,0.06,3\n");
  EXPECT_THAT(ProblemsIn(twice), HasSubstr("step 1 of sample 0 stands here for the second time"));
}

TEST(LaboratoryFiles, RunsThatNoParameterMovesAreWarnedOf) {
  const auto outcome = ReadRuns(
      "0,0,0,1\n0,1,0.01,2\n0,2,0.02,4\n0,3,0.03,6\n1,0,0,1\n1,1,0.01,2\n1,2,0.02,4\n1,3,0.03,6\n");
  EXPECT_EQ(OnlyWarning(outcome), "unmoved mean_stress");
}

// One campaign on a file of the measurements; skipped where they are not.
ReadOutcome ReadFromDisk(const std::string& file, const std::string& experiment) {
  const std::string yaml =
      absl::StrCat("name: a\nmodel: {contact: hertz_mindlin, fixed: {poisson_ratio: 0.2}}\n",
                   "parameters: {young_modulus: {prior: log_uniform, min: 0.3 GPa, max: 3 GPa}, ",
                   "friction_coefficient: {prior: uniform, min: 0.2, max: 0.8}}\n",
                   "experiments:\n  - name: tx\n",
                   "    packing: {generate: {particles: 64, porosity: 0.43, radii: {mean: 1.5 mm, "
                   "spread: 0.3}, ",
                   "seed: 1}}\n", "    data:\n      file: $CALIB_DATA/", file, "\n", experiment,
                   "noise: given\ninference: {method: sqmc, samples: 4}\nseed: 7\n");
  return ReadCampaign(yaml, "c.yaml", DiskReader("c.yaml"));
}

TEST(LaboratoryFiles, AreReadByKeysAloneOnTheMeasurements) {
  if (!DiskReader("c.yaml")("$CALIB_DATA/karlsruhe_sand/TMD6.dat").ok()) {
    GTEST_SKIP() << "left out: there is no $CALIB_DATA/karlsruhe_sand here";
  }
  struct Sand {
    const char* name;
    int pressure;  // kPa
    const char* void_ratio;
    double largest;  // q/p
  };
  for (const Sand& sand :
       {Sand{"TMD6", 51, "Void ratio", 1.50}, Sand{"TMD8", 200, "Void ratio", 1.48},
        Sand{"TMD10", 405, "Porenzahl", 1.45}, Sand{"TMD11", 52, "Void ratio", 1.63},
        Sand{"TMD13", 200, "Void ratio", 1.50}, Sand{"TMD15", 392, "Void ratio", 1.52},
        Sand{"TMD21", 49, "Void ratio", 1.74}, Sand{"TMD23", 201, "Void ratio", 1.75},
        Sand{"TMD25", 399, "Void ratio", 1.65}}) {
    const auto outcome = ReadFromDisk(
        absl::StrCat("karlsruhe_sand/", sand.name, ".dat"),
        absl::StrCat("      columns: {axial_strain: eps1, volumetric_strain: epsv, void_ratio: ",
                     sand.void_ratio, ", q_over_p: eta = q/p}\n",
                     "      units: {axial_strain: percent, volumetric_strain: percent}\n",
                     "    test: triaxial_drained\n    confining_pressure: ", sand.pressure,
                     " kPa\n    control: axial_strain\n    observables: {q_over_p: {noise: "
                     "{absolute: 0.03}}, volumetric_strain: {noise: {absolute: 0.2 percent}}, "
                     "void_ratio: {noise: {absolute: 0.01}}}\n"));
    ASSERT_EQ(ProblemsIn(outcome), "") << sand.name;
    for (const Warning& warning : outcome.warnings) {  // rows stand close and scatter less
      EXPECT_EQ(warning.kind, WarningKind::kScatter) << sand.name << Sentence(warning);
    }
    EXPECT_NEAR(SummaryOf(First(outcome)).max, sand.largest, 0.01) << sand.name;
    EXPECT_GT(SummaryOf(First(outcome)).readings, 390) << sand.name;
  }
  const std::string real = "laboratory_files/real/";
  struct Real {
    const char* file;
    std::string keys;
    int readings;
    double first;  // SI
  };
  for (const Real& r :
       {Real{
            "sand_database_KFS_head.csv",
            "      where: {test_id: TMD1}\n      columns: {axial_strain: eps_a, deviatoric_stress: "
            "q}\n      formulas: {q: \"$5 - $4\"}\n      units: {axial_strain: percent, "
            "deviatoric_stress: kPa}\n    test: triaxial_drained\n    confining_pressure: 50.6 "
            "kPa\n    control: axial_strain\n    observables: {deviatoric_stress: {noise: "
            "{absolute: 3 kPa}}}\n",
            16, 2.13e3},
        Real{"leap2017_cyclic_head.tsv",
             "      columns: {axial_strain: eps_a, deviatoric_stress: sigma_d_kPa}\n      units: "
             "{axial_strain: percent, deviatoric_stress: kPa}\n    test: triaxial_undrained\n    "
             "confining_pressure: 99.7 kPa\n    control: axial_strain\n    observables: "
             "{deviatoric_stress: {noise: {absolute: 3 kPa}}}\n",
             30, 2.671e3},
        Real{"usgs_kaolin_oedometer_points.csv",
             "      columns: {axial_stress: stressMPa, void_ratio: e}\n      units: {axial_stress: "
             "MPa}\n    test: oedometric\n    confining_pressure: 27.8 kPa\n    control: "
             "axial_stress\n    observables: {void_ratio: {noise: {absolute: 0.02}}}\n",
             12, 1.5694009223781145},
        Real{"oedo_obsdata.dat",
             "      columns: {axial_strain: e_a, mean_stress: p, porosity: n}\n      units: "
             "{mean_stress: MPa}\n      strain: logarithmic\n    test: oedometric\n    "
             "confining_pressure: 5.6 MPa\n    control: axial_strain\n    observables: "
             "{mean_stress: {noise: {relative: 0.02}}, porosity: {noise: {absolute: 0.002}}}\n",
             101, 5.5873e6},
        Real{
            "TMU12_first1500lines.dat",
            "      columns: {axial_strain: eps1, deviatoric_stress: q, mean_stress: p}\n      "
            "units: {axial_strain: percent, deviatoric_stress: kPa, mean_stress: kPa}\n    test: "
            "triaxial_undrained\n    confining_pressure: 200.5 kPa\n    control: axial_strain\n    "
            "observables: {deviatoric_stress: {noise: {absolute: 2 kPa}}, mean_stress: {noise: "
            "{absolute: 2 kPa}}}\n",
            1497, -0.725e3}}) {
    const auto outcome = ReadFromDisk(real + r.file, r.keys);
    ASSERT_EQ(ProblemsIn(outcome), "") << r.file;
    EXPECT_EQ(SummaryOf(First(outcome)).readings, r.readings) << r.file;
    EXPECT_NEAR(First(outcome).values[0], r.first, 1e-9 * std::abs(r.first)) << r.file;
    for (const Warning& warning : outcome.warnings) {
      EXPECT_TRUE(warning.kind == WarningKind::kScatter || warning.kind == WarningKind::kUnit ||
                  warning.kind == WarningKind::kOffset)
          << r.file << " " << Sentence(warning);
    }
  }
}

// Overlap and force of one contact: no test of the catalogue, so that runs made elsewhere stand in.
TEST(LaboratoryFiles, ATableOfAnyQuantitiesIsReadWithRunsMadeElsewhereOnTheMeasurements) {
  const auto file = DiskReader("c.yaml")("$CALIB_DATA/laboratory_files/real/collision_obs.txt");
  if (!file.ok()) GTEST_SKIP() << "left out: there is no $CALIB_DATA/laboratory_files here";
  std::string states = "sample,step,f\n";
  for (int sample = 0; sample < 2; ++sample) {
    for (int step = 0; step < 80; ++step) {
      absl::StrAppend(&states, sample, ",", step, ",", 1e4 * (1 + sample) * step, "\n");
    }
  }
  const auto outcome = ReadCampaign(
      "name: a\nmodel: {precomputed: {parameters: p.csv, states: s.csv}}\n"
      "parameters: {k: {prior: uniform, min: 0, max: 10}}\n"
      "experiments:\n  - name: contact\n    data: {file: d.txt}\n    control: u\n"
      "    observables: {f: {noise: {relative: 0.05}}}\n"
      "noise: given\ninference: {method: sqmc}\nseed: 7\n",
      "c.yaml", ReaderOf({{"d.txt", *file}, {"p.csv", "sample,k\n0,1\n1,2\n"}, {"s.csv", states}}));
  ASSERT_EQ(ProblemsIn(outcome), "");
  const Experiment& experiment = outcome.campaign.experiments.at(0);
  ASSERT_EQ(experiment.control.size(), 80U);
  EXPECT_EQ(experiment.control.front(), 0.0020000000000000018);
  EXPECT_EQ(First(outcome).values.front(), 87632.96451113821);
  EXPECT_EQ(First(outcome).values.back(), 965106.6363584101);
}

}  // namespace
}  // namespace calib::campaign
