#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/campaign/file/read_precomputed.h"
#include "server/methods/registry.h"
#include "tests/unit/campaign/good_campaign.h"

namespace calib::campaign {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::ProblemsOf;
using testing::ReaderOf;

// The shape of the published glass-bead tables: columns under other names, in other units, one
// negative stiffness.
std::map<std::string, std::string> Tables() {
  return {
      {"exp.dat", "#\t\te_a\t\tp\t\tn\n0.0\t1.0\t0.40\t\n0.1\t2.0\t0.39\t\n0.05\t1.5\t0.392\t\n"},
      {"par.csv", "sample,E_GPa,km_nNm\n0,100,8000\n1,120,-5000\n"},
      {"sta.csv",
       "sample,step,p_MPa,porosity\n0,0,1.1,0.4\n0,1,2.1,0.39\n0,2,1.4,0.393\n1,0,0.9,0.4\n1,1,1.9,"
       "0.38\n"}};
}

std::string BeadsYaml() {
  return R"(name: beads
model:
  precomputed:
    parameters: par.csv
    states: sta.csv
    parameter_columns: {young_modulus: E_GPa, rolling_stiffness: km_nNm}
    parameter_units: {young_modulus: GPa, rolling_stiffness: nN m/rad}
    state_columns: {mean_stress: p_MPa}
    state_units: {mean_stress: MPa}
    absolute: [rolling_stiffness]
parameters:
  young_modulus: {prior: uniform, min: 50 GPa, max: 200 GPa}
  rolling_stiffness: {prior: uniform, min: 0 N m/rad, max: 1e-5 N m/rad}
experiments:
  - name: oedo
    test: oedometric
    confining_pressure: 5 MPa
    data: {file: exp.dat, columns: {axial_strain: e_a, mean_stress: p, porosity: n}, units: {mean_stress: MPa}, strain: logarithmic}
    control: axial_strain
    observables: {mean_stress: {}, porosity: {weight: 0.01}}
noise: {ess_target: 0.2}
inference: {method: sqmc}
)";
}

TEST(Precomputed, ReadsBothTablesInSi) {
  const ReadOutcome outcome =
      ReadCampaign(methods::All(), BeadsYaml(), "c.yaml", ReaderOf(Tables()));
  ASSERT_EQ(ProblemsOf(BeadsYaml(), Tables()), "");
  const Campaign& c = outcome.campaign;
  ASSERT_TRUE(c.precomputed.has_value());
  EXPECT_EQ(c.samples, 2);
  EXPECT_EQ(c.parameters[1].unit, "N m/rad");
  EXPECT_DOUBLE_EQ(c.precomputed->parameters(1, 0), 1.2e11);
  EXPECT_DOUBLE_EQ(c.precomputed->parameters(1, 1), 5e-6);  // the sign the simulation ignored
  const auto& states = c.precomputed->values.at(0);
  EXPECT_DOUBLE_EQ(states[0][2 * 1 + 0], 2.1e6);
  EXPECT_DOUBLE_EQ(states[0][2 * 2 + 1], 0.393);
  EXPECT_TRUE(std::isnan(states[1][2 * 2 + 0]));  // not in the table: a run that did not end
  EXPECT_DOUBLE_EQ(MakeDataSet(c).ess_weights[0][1], 0.01);
  EXPECT_EQ(c.experiments[0].segment.back(), "unload_1");
}

TEST(Precomputed, CountsStepsFromOneToo) {
  auto files = Tables();
  files["sta.csv"] = "sample,step,p_MPa,porosity\n0,1,1.1,0.4\n0,2,2.1,0.39\n0,3,1.4,0.393\n";
  const ReadOutcome outcome = ReadCampaign(methods::All(), BeadsYaml(), "c.yaml", ReaderOf(files));
  ASSERT_THAT(outcome.problems, IsEmpty());
  EXPECT_DOUBLE_EQ(outcome.campaign.precomputed->values[0][0][0], 1.1e6);
}

TEST(Precomputed, SaysWhichTableIsWrong) {
  auto files = Tables();
  files["par.csv"] = "sample,E_GPa,km_nNm\n0,100,8000\n0,120,-5000\n";
  EXPECT_THAT(ProblemsOf(BeadsYaml(), files),
              HasSubstr("par.csv:3: sample: sample 0 stands here for the second time"));
  EXPECT_THAT(ProblemsOf(BeadsYaml(), files),
              HasSubstr("sta.csv:5: sample: sample 1 is not in par.csv"));
  files = Tables();
  files["sta.csv"] = "sample,step,p_MPa,porosity\n0,0,1.1,0.4\n0,7,2.1,0.39\n";
  EXPECT_THAT(ProblemsOf(BeadsYaml(), files),
              HasSubstr("the steps run from 0 to 7, but oedo has 3 readings"));
  files["sta.csv"] = "sample,step,p_MPa,porosity\n0,1,1.1,0.4\n0,2,2.1,0.39\n";
  EXPECT_THAT(ProblemsOf(BeadsYaml(), files),
              HasSubstr("the steps run from 1 to 2, but oedo has 3 readings"));
  files["sta.csv"] =
      "sample,step,p_MPa,porosity\n0,0,1.1,0.4\n0,1,2.1,0.39\n0,1,99,0.39\n0,2,1.4,0.393\n";
  EXPECT_EQ(ProblemsOf(BeadsYaml(), files),
            "sta.csv:4: step: step 1 of sample 0 stands here for the second time\n");
  files = Tables();
  files["par.csv"] = "sample,E_GPa,km_nNm,E_GPa\n0,100,8000,1\n1,120,-5000,1\n";
  EXPECT_EQ(ProblemsOf(BeadsYaml(), files),
            "par.csv:1: E_GPa: is the name of more than one column\n");
  files = Tables();
  files["par.csv"] = "sample,E,km_nNm\n0,100,8000\n";
  EXPECT_THAT(ProblemsOf(BeadsYaml(), files),
              HasSubstr("par.csv:1: E_GPa: is not a column of this file"));
}

TEST(Precomputed, ARepeatedSampleBesideOthersIsNamedToo) {
  auto files = Tables();
  files["par.csv"] = "sample,E_GPa,km_nNm\n0,100,8000\n0,120,-5000\n1,130,4000\n";
  EXPECT_EQ(ProblemsOf(BeadsYaml(), files),
            "par.csv:3: sample: sample 0 stands here for the second time\n");
}

TEST(Precomputed, OneSetOfParametersIsNoSample) {
  auto files = Tables();
  files["par.csv"] = "sample,E_GPa,km_nNm\n0,100,8000\n1,100,-8000\n";
  EXPECT_EQ(ProblemsOf(BeadsYaml(), files),
            "par.csv: all 2 rows hold the same parameters: young_modulus 1e+11 Pa, "
            "rolling_stiffness 8e-06 N m/rad; a calibration needs runs at different ones\n");
}

TEST(Precomputed, RepeatedSetsAreWarnedOf) {
  const auto repeated = [](const Warning& w) { return w.kind == WarningKind::kRepeated; };
  const auto plain =
      ReadCampaign(methods::All(), BeadsYaml(), "c.yaml", ReaderOf(Tables())).warnings;
  EXPECT_TRUE(std::none_of(plain.begin(), plain.end(), repeated));
  auto files = Tables();
  files["par.csv"] = "sample,E_GPa,km_nNm\n0,100,8000\n1,100,8000\n2,120,5000\n3,100,8000\n";
  const auto outcome = ReadCampaign(methods::All(), BeadsYaml(), "c.yaml", ReaderOf(files));
  ASSERT_THAT(outcome.problems, IsEmpty());
  const auto found = std::find_if(outcome.warnings.begin(), outcome.warnings.end(), repeated);
  ASSERT_NE(found, outcome.warnings.end());
  EXPECT_THAT(found->message,
              HasSubstr("2 of the 4 runs made elsewhere repeat the parameters of another"));
}

TEST(Precomputed, AMisspeltNameIsNotPassedOver) {
  std::string yaml = BeadsYaml();
  yaml.replace(yaml.find("[rolling_stiffness]"), 19, "[roling_stiffness]");
  EXPECT_THAT(ProblemsOf(yaml, Tables()),
              HasSubstr("absolute: 'roling_stiffness' is not used in this campaign; did you mean "
                        "'rolling_stiffness'?"));
}

TEST(Precomputed, RefusesWhatOnlyASimulationNeeds) {
  std::string yaml = BeadsYaml();
  yaml.replace(yaml.find("    control:"), 0, "    packing: {file: p.txt}\n");
  EXPECT_EQ(ProblemsOf(yaml, Tables()),
            "c.yaml:19: experiments[1].packing: has no meaning with precomputed runs; remove it\n");
}

// Rows of two effects of the user's code: none, one, the other, both.
std::map<std::string, std::string> TablesWithEffects() {
  auto files = Tables();
  files["par.csv"] =
      "sample,E_GPa,km_nNm,friction_mN,glue\n3,100,8000,0,0\n4,110,7000,200,0\n5,120,5000,0,0\n"
      "6,130,6000,0,0.5\n7,140,6000,100,0.25\n";
  files["sta.csv"] = "sample,step,p_MPa,porosity\n";
  for (const char* sample : {"3", "4", "5", "6", "7"}) {
    for (const char* step : {",0,1.", ",1,2.", ",2,1.5"})
      files["sta.csv"] += std::string(sample) + step + sample + ",0.39\n";
  }
  return files;
}

std::string EffectsYaml() {
  std::string yaml = BeadsYaml();
  const std::string keys = "    absolute: [rolling_stiffness]\n";
  yaml.insert(yaml.find(keys) + keys.size(), R"(    effects:
      rolling:
        parameters: {rolling.limit: {null: 0, unit: N, prior: {prior: uniform, min: 0, max: 0.5 N}}}
        excludes: [bonds]
      bonds:
        parameters: {strength: {null: 0, prior: {prior: uniform, min: 0, max: 1}}}
)");
  const auto put = [&yaml](const std::string& before, const std::string& what) {
    yaml.insert(yaml.find(before) + before.size(), what);
  };
  put("rolling_stiffness: km_nNm", ", rolling.limit: friction_mN, bonds.strength: glue");
  put("nN m/rad", ", rolling.limit: mN");
  return yaml;
}

std::string WithText(std::string text, const std::string& from, const std::string& to) {
  return text.replace(text.find(from), from.size(), to);
}

TEST(Precomputed, RowsThatHaveEffectsDoNotCalibrate) {
  ASSERT_EQ(ProblemsOf(EffectsYaml(), TablesWithEffects()), "");
  const Campaign c =
      ReadCampaign(methods::All(), EffectsYaml(), "c.yaml", ReaderOf(TablesWithEffects())).campaign;
  EXPECT_EQ(c.samples, 2);
  EXPECT_EQ(c.precomputed->parameters.col(0), Eigen::Vector2d(1e11, 1.2e11));
  EXPECT_DOUBLE_EQ(c.precomputed->values[0][1][0], 1.5e6);
  const RunsWithEffects& with = c.precomputed->with_effects;
  EXPECT_EQ(with.names, (std::vector<std::string>{"rolling.limit", "bonds.strength"}));
  ASSERT_EQ(with.parameters.rows(), 3);
  const Eigen::RowVectorXd last = with.parameters.row(2);
  EXPECT_DOUBLE_EQ(last[0], 1.4e11);
  EXPECT_DOUBLE_EQ(last[2], 0.1);
  EXPECT_DOUBLE_EQ(last[3], 0.25);
  ASSERT_EQ(with.values.at(0).size(), 3U);
  EXPECT_DOUBLE_EQ(with.values[0][2][2], 2.7e6);
  ASSERT_EQ(c.model.user_effects.size(), 2U);
  EXPECT_EQ(c.model.user_effects[0].info.excludes, std::vector<std::string>{"bonds"});
  EXPECT_FALSE(c.model.user_effects[1].info.two_sided);
}

TEST(Precomputed, WhatIsWrongWithTheEffectsOfRowsIsSaidOnce) {
  const auto problems = [](const std::string& from, const std::string& to) {
    return ProblemsOf(WithText(EffectsYaml(), from, to), TablesWithEffects());
  };
  EXPECT_EQ(problems("bonds.strength: glue", "bonds.strength: glu"),
            "par.csv:1: glu: is not a column of this file; did you mean 'glue'?\n");
  EXPECT_THAT(problems("bonds.strength: glue", "bonds.strength: friction_mN"),
              HasSubstr("rolling.limit and bonds.strength would both be read from the column "
                        "'friction_mN'"));
  EXPECT_THAT(problems("[bonds]", "[bond]"), HasSubstr("'bond' is none of the others"));
  EXPECT_THAT(problems("strength: {null: 0, ", "strength: {"), HasSubstr("none has a null"));
  EXPECT_THAT(problems("rolling.limit: mN", "rolling.limit: MPa"), HasSubstr("expected a force"));
  EXPECT_THAT(problems("      bonds:", "      capillary_bridges:"),
              HasSubstr("is an effect of this build; call that of your runs another"));
  auto files = TablesWithEffects();
  files["par.csv"] = WithText(files["par.csv"], "6000,0,0.5", "6000,0,-0.5");
  EXPECT_THAT(
      ProblemsOf(EffectsYaml(), files),
      HasSubstr("par.csv:5: glue: bonds.strength is -0.5, on the other side of its null 0"));
  files["par.csv"] =
      "sample,E_GPa,km_nNm,friction_mN,glue\n3,100,8000,0,0\n4,110,7000,0,0\n5,120,"
      "5000,0,0\n6,130,6000,0,0\n7,140,6000,0,0\n";
  EXPECT_THAT(ProblemsOf(EffectsYaml(), files), HasSubstr("par.csv: no row has an effect"));
  files["par.csv"] =
      "sample,E_GPa,km_nNm,friction_mN,glue\n3,100,8000,0,1\n4,110,7000,0,1\n5,120,"
      "5000,0,1\n6,130,6000,0,1\n7,140,6000,0,1\n";
  EXPECT_THAT(ProblemsOf(EffectsYaml(), files), HasSubstr("par.csv: every row has an effect"));
}

TEST(Precomputed, AFormulaThatActsOnNothingIsRefused) {
  std::string yaml = BeadsYaml();
  yaml.insert(
      yaml.find("  precomputed:"),
      "  user_effects: {soft: {adds: porosity, formula: \"a * axial_strain\", parameters: {a: "
      "{null: 0}}}}\n");
  EXPECT_THAT(ProblemsOf(yaml, Tables()),
              HasSubstr("user_effects: acts on runs of this program's"));
}

TEST(Precomputed, ZeroReadingsHaveNoSizeToScaleErrorsWith) {
  auto files = Tables();
  files["exp.dat"].replace(files["exp.dat"].find("1.0"), 3, "0.0");
  EXPECT_EQ(ProblemsOf(BeadsYaml(), files),
            "c.yaml:20: experiments[1].observables.mean_stress: is zero in exp.dat:2, but "
            "ess_target scales errors with "
            "the reading; leave the row out or use noise: given\n");
}

}  // namespace
}  // namespace calib::campaign
