// The collection of files that laboratories brought ($CALIB_DATA/laboratory_files): each folder is
// a campaign that was once misread in silence or refused without need, and is read as its README
// says.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "server/campaign/checks/experiment_summary.h"
#include "server/campaign/file/campaign_file.h"
#include "server/methods/registry.h"

namespace calib::campaign {
namespace {

namespace fs = std::filesystem;

// What is said of a case: kinds of its problems, else of its warnings with the names they are
// about, in order.
std::vector<std::string> SaidOf(const ReadOutcome& outcome) {
  std::vector<std::string> said;
  for (const Problem& problem : outcome.problems) said.push_back("refused " + problem.kind);
  for (const Warning& warning : outcome.warnings) {
    said.push_back(absl::StrCat(WordOf(kWarningKindWords, warning.kind), " ", warning.name));
  }
  return said;
}

struct LaboratoryCase {
  std::string folder;
  std::vector<std::string> said;   // as SaidOf() says it
  std::vector<double> first = {};  // values of the first observable, SI; NaN: missing
  int turning_points = 0;
};

const std::vector<LaboratoryCase>& LaboratoryCases() {
  static const auto* const cases = new std::vector<LaboratoryCase>{
      {.folder = "compare_factor_words",
       .said = {},
       .first = {8, 234409, 420543, 519775, 567828, 604454}},
      {.folder = "control_noise_flattens_path", .said = {"refused control_noise"}},
      {.folder = "first_strain_minus_hundredth",
       .said = {"offset axial_strain"},
       .first = {0.98, 1.5, 1.75, 1.95, 2.05}},
      {.folder = "header_blank_in_name_shift", .said = {}, .first = {1e3, 50e3, 75e3}},
      {.folder = "header_units_shift", .said = {}, .first = {1e3, 50e3, 75e3}},
      {.folder = "heap_of_too_few_grains",
       .said = {"few_grains angle_of_repose"},
       .first = {29 * std::numbers::pi / 180}},
      {.folder = "held_quantity_observed", .said = {"refused held"}},
      {.folder = "kpa_without_unit", .said = {"unit axial_stress"}, .first = {200, 300, 350, 390}},
      {.folder = "nan_in_one_cell", .said = {}, .first = {1, 1.5, 1.7}},
      {.folder = "noise_without_unit",
       .said = {"error_size volumetric_strain", "error_size volumetric_strain",
                "error_size stress_ratio"},
       .first = {0, 0.0012, 0.0014}},
      {.folder = "precomputed_other_strains", .said = {}, .first = {1e6, 1.3e6, 1.9e6, 2.4e6}},
      {.folder = "quoted_numbers", .said = {}, .first = {1, 1.5, 1.7}},
      {.folder = "same_reading_four_times",
       .said = {"redundant deviatoric_stress", "redundant axial_stress", "redundant q_over_p"}},
      {.folder = "sign_of_strain", .said = {"sign axial_strain"}, .first = {0, 1e5, 1.5e5, 1.9e5}},
      {.folder = "silo_opening", .said = {"refused impossible"}}};
  return *cases;
}

ReadOutcome ReadCase(const fs::path& folder) {
  std::ifstream file(folder / "c.yaml");
  const std::string yaml{std::istreambuf_iterator<char>(file), {}};
  return ReadCampaign(methods::All(), yaml, "c.yaml", DiskReader((folder / "c.yaml").string()));
}

std::optional<fs::path> Collection() {
  const char* data = std::getenv("CALIB_DATA");
  const fs::path folder = fs::path(data != nullptr ? data : "") / "laboratory_files";
  if (data == nullptr || !fs::exists(folder)) return std::nullopt;
  return folder;
}

TEST(LaboratoryCases, AreReadAsTheyAreMeantOnTheMeasurements) {
  const auto collection = Collection();
  if (!collection) GTEST_SKIP() << "left out: there is no $CALIB_DATA/laboratory_files here";
  for (const LaboratoryCase& c : LaboratoryCases()) {
    const auto outcome = ReadCase(*collection / c.folder);
    EXPECT_EQ(SaidOf(outcome), c.said) << c.folder;
    if (c.first.empty() || !outcome.problems.empty()) continue;
    const Experiment& experiment = outcome.campaign.experiments.at(0);
    const std::vector<double>& values = experiment.observables.at(0).values;
    ASSERT_EQ(values.size(), c.first.size()) << c.folder;
    for (std::size_t i = 0; i < values.size(); ++i) {
      EXPECT_NEAR(values[i], c.first[i], 1e-9 * std::max(1.0, std::abs(c.first[i]))) << c.folder;
    }
    EXPECT_EQ(SummaryOf(experiment).turning_points, c.turning_points) << c.folder;
  }
}

// A case that joins the collection needs a row here.
TEST(LaboratoryCases, HaveEachARowOnTheMeasurements) {
  const auto collection = Collection();
  if (!collection) GTEST_SKIP() << "left out: there is no $CALIB_DATA/laboratory_files here";
  for (const auto& entry : fs::directory_iterator(*collection)) {
    if (!fs::exists(entry.path() / "c.yaml")) continue;
    const std::string folder = entry.path().filename();
    EXPECT_TRUE(std::any_of(LaboratoryCases().begin(), LaboratoryCases().end(),
                            [&folder](const LaboratoryCase& c) { return c.folder == folder; }))
        << folder;
  }
}

// The runs go on at 0, 2, 4 and 6 % where the readings are at 0, 1, 2 and 3 %.
TEST(LaboratoryCases, RunsAtOtherStrainsAreInterpolatedOnTheMeasurements) {
  const auto collection = Collection();
  if (!collection) GTEST_SKIP() << "left out: there is no $CALIB_DATA/laboratory_files here";
  const auto outcome = ReadCase(*collection / "precomputed_other_strains");
  ASSERT_TRUE(outcome.campaign.precomputed.has_value());
  const auto& runs = outcome.campaign.precomputed->values.at(0);
  ASSERT_EQ(runs.size(), 20U);
  for (std::size_t sample = 0; sample < runs.size(); ++sample) {
    const double stiff = 5 + 10 * static_cast<double>(sample);  // p = 1 + stiff e / 4 [MPa]
    for (std::size_t i = 0; i < 4; ++i) {
      const double strain = 0.01 * static_cast<double>(i);
      EXPECT_NEAR(runs[sample][i], 1e6 * (1 + 0.25 * stiff * strain), 10) << sample << " " << i;
    }
  }
}

TEST(LaboratoryCases, ALostReadingIsCountedOnTheMeasurements) {
  const auto collection = Collection();
  if (!collection) GTEST_SKIP() << "left out: there is no $CALIB_DATA/laboratory_files here";
  const auto summary =
      SummaryOf(ReadCase(*collection / "nan_in_one_cell").campaign.experiments.at(0));
  EXPECT_EQ(summary.observables.at(0).readings, 3);
  EXPECT_EQ(summary.observables.at(1).name, "volumetric_strain");
  EXPECT_EQ(summary.observables.at(1).readings, 2);
  EXPECT_EQ(summary.observables.at(1).missing, 1);
}

}  // namespace
}  // namespace calib::campaign
