// What an inspection says of every measurement in $CALIB_DATA: golden.txt, a line for each column
// and finding. CALIB_WRITE_GOLDEN=FILE writes what is said now, to be read before it is kept.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "server/inspection/header_words.h"
#include "server/inspection/inspect_file.h"

namespace calib::inspection {
namespace {

namespace fs = std::filesystem;

std::string DataFolder() {
  const char* data = std::getenv("CALIB_DATA");
  return data != nullptr ? data : "";
}

std::vector<fs::path> Measurements(const fs::path& root) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(root)) {
    const std::string name = entry.path().filename().string();
    const std::string ending = entry.path().extension().string();
    const bool table = ending == ".dat" || ending == ".csv" || ending == ".tsv" ||
                       (ending == ".txt" && name.starts_with("collision"));
    // Runs of models are no measurements.
    if (table && !name.starts_with("ensemble")) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

// One line for each column, one for each kind of finding.
std::string Said(const InspectedFile& file) {
  if (!file.problems.empty())
    return absl::StrCat("  refused: ", file.problems.front().message, "\n");
  const Inspection& in = file.inspection;
  std::string text =
      absl::StrCat("  ", DelimiterWord(in.table.parting), " ", DecimalWord(in.table.mark), " ",
                   in.table.encoding, ", ", in.table.header_lines, " lines above ", in.rows,
                   " rows, ", in.tests.size(), " tests\n");
  for (const ColumnMeaning& column : in.columns) {
    absl::StrAppend(&text, "  ", column.name, ": ", column.open ? "?" : "",
                    column.sign < 0 ? "-" : "", column.role, " [", column.unit, "]\n");
  }
  std::map<std::string, int> kinds;
  for (const Finding& finding : in.findings) {
    ++kinds[absl::StrCat(finding.odd ? "! " : "- ", WordOf(kFindingWords, finding.kind))];
  }
  for (const auto& [kind, count] : kinds) absl::StrAppend(&text, "  ", kind, " x ", count, "\n");
  return text;
}

std::string SaidOfAll() {
  std::string text;
  for (const fs::path& path : Measurements(DataFolder())) {
    absl::StrAppend(&text, fs::relative(path, DataFolder()).string(), "\n",
                    Said(InspectFile(path.string(), "", {})));
  }
  return text;
}

TEST(InspectionGolden, OfEveryMeasurementTheSameIsSaid) {
  if (DataFolder().empty()) GTEST_SKIP() << "CALIB_DATA is not set";
  const std::string now = SaidOfAll();
  if (const char* file = std::getenv("CALIB_WRITE_GOLDEN")) std::ofstream(file) << now;
  std::ifstream golden(CALIB_GOLDEN);
  std::ostringstream kept;
  kept << golden.rdbuf();
  ASSERT_FALSE(kept.str().empty());
  EXPECT_EQ(now, kept.str());
}

TEST(InspectionGolden, NothingIsOddInTheDataOfShippedCampaigns) {
  if (DataFolder().empty()) GTEST_SKIP() << "CALIB_DATA is not set";
  std::vector<fs::path> files = Measurements(CALIB_EXAMPLES);
  for (const char* folder : {"toyoura_triaxial", "glass_beads_oedometric", "triaxial_sqmc_example",
                             "yade_cases", "steel_disk_restitution"}) {
    for (const fs::path& path : Measurements(fs::path(DataFolder()) / folder))
      files.push_back(path);
  }
  for (const fs::path& path : files) {
    for (const Finding& finding : InspectFile(path.string(), "", {}).inspection.findings) {
      EXPECT_FALSE(finding.odd) << path << ": " << finding.text;
    }
  }
}

// What an engineer reads in these files, stated by hand.
TEST(InspectionGolden, AnEngineerReadsTheSame) {
  if (DataFolder().empty()) GTEST_SKIP() << "CALIB_DATA is not set";
  struct Reading {
    const char *file, *column, *role, *unit;
  };
  for (const Reading& reading : {
           Reading{"toyoura_triaxial/experiment_0.2MPa.dat", "e_z", "axial_strain", "percent"},
           Reading{"toyoura_triaxial/experiment_0.2MPa.dat", "s33_over_s11", "stress_ratio", "1"},
           Reading{"glass_beads_oedometric/experiment.dat", "e_a", "axial_strain", "1"},
           Reading{"glass_beads_oedometric/experiment.dat", "n", "porosity", "1"},
           Reading{"karlsruhe_sand/TMD10.dat", "Porenzahl", "void_ratio", "1"},
           Reading{"karlsruhe_sand/TMD10.dat", "p", "mean_stress", "kPa"},
           Reading{"karlsruhe_sand/TMD21.dat", "eta = q/p", "q_over_p", "1"},
           Reading{"laboratory_files/real/TMU12_first1500lines.dat", "sigma3'", "lateral_stress",
                   "kPa"},
           Reading{"laboratory_files/real/TMU12_first1500lines.dat", "sigma3", kTotalLateral,
                   "kPa"},
           Reading{"laboratory_files/real/leap2017_cyclic_head.tsv", "sigmaP_3_kPa",
                   "lateral_stress", "kPa"},
           Reading{"laboratory_files/real/sand_database_KFS_head.csv", "sigma_v", "axial_stress",
                   "kPa"},
           Reading{"laboratory_files/real/usgs_kaolin_oedometer_points.csv", "e", "void_ratio",
                   "1"},
       }) {
    const InspectedFile file =
        InspectFile((fs::path(DataFolder()) / reading.file).string(), "", {});
    const auto column =
        std::find_if(file.inspection.columns.begin(), file.inspection.columns.end(),
                     [&reading](const auto& c) { return c.name == reading.column; });
    ASSERT_NE(column, file.inspection.columns.end()) << reading.file << " " << reading.column;
    EXPECT_EQ(column->role, reading.role) << reading.file << " " << reading.column;
    EXPECT_EQ(column->unit, reading.unit) << reading.file << " " << reading.column;
  }
}

}  // namespace
}  // namespace calib::inspection
