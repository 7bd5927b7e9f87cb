// Files of real laboratories, read by keys of the campaign file alone.
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

using testing::ReaderOf;

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
  return ReadCampaign(methods::All(), yaml, "c.yaml", DiskReader("c.yaml"));
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
      methods::All(),
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
