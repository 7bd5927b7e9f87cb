// Tables as laboratories write them: how they part cells, name columns and leave readings out.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "absl/strings/str_cat.h"
#include "server/campaign/checks/experiment_summary.h"
#include "server/methods/registry.h"
#include "tests/unit/campaign/good_campaign.h"
#include "tests/unit/campaign/laboratory.h"

namespace calib::campaign {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pointwise;
using testing::ReaderOf;

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
      methods::All(),
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

}  // namespace
}  // namespace calib::campaign
