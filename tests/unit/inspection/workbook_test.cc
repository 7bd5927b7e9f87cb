// Workbooks made by openpyxl itself; where it is not installed only its absence is tested.
#include "server/campaign/file/text/workbook.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "server/inspection/inspect_file.h"

namespace calib::inspection {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

class Workbook : public ::testing::Test {
 protected:
  Workbook() {
    std::string pattern = (fs::temp_directory_path() / "calib-workbook-XXXXXX").string();
    folder_ = mkdtemp(pattern.data());
  }
  ~Workbook() override { fs::remove_all(folder_); }

  // Runs lines of Python that fill `book`, and saves it. False: openpyxl is not there.
  [[nodiscard]] bool Make(const std::string& lines) const {
    const fs::path script = folder_ / "make.py";
    std::ofstream(script) << "import openpyxl, datetime\nbook = openpyxl.Workbook()\n"
                          << "sheet = book.active\nsheet.title = 'Data'\n"
                          << lines << "\nbook.save('" << path() << "')\n";
    return std::system(absl::StrCat("/usr/bin/python3 -I ", script.string()).c_str()) == 0;
  }
  [[nodiscard]] std::string path() const { return (folder_ / "t.xlsx").string(); }

  fs::path folder_;
};

constexpr const char* kRows =
    "for row in [['eps1 [%]', 'q [kPa]'], [0, 0.1], [1, 100.123456789], [2, 150]]: "
    "sheet.append(row)\n";

TEST_F(Workbook, ASheetIsReadWithAllItsDigits) {
  if (!Make(kRows)) GTEST_SKIP() << "python3-openpyxl is not installed";
  const InspectedFile answer = InspectFile(path(), "", {});
  ASSERT_TRUE(answer.problems.empty()) << answer.problems.front().message;
  EXPECT_DOUBLE_EQ(answer.inspection.Values(0, "deviatoric_stress")[1], 100123.456789);
}

TEST_F(Workbook, OfSeveralSheetsOneIsNamed) {
  if (!Make(absl::StrCat(kRows, "other = book.create_sheet('Other')\n",
                         "for row in [['a', 'b'], [1, 2], [3, 4]]: other.append(row)\n"))) {
    GTEST_SKIP() << "python3-openpyxl is not installed";
  }
  EXPECT_THAT(InspectFile(path(), "", {}).problems.front().message, HasSubstr("'Data', 'Other'"));
  EXPECT_THAT(InspectFile(path(), "Dta", {}).problems.front().message, HasSubstr("no sheet 'Dta'"));
  EXPECT_TRUE(InspectFile(path(), "Data", {}).problems.empty());
}

TEST_F(Workbook, ANotesSheetBesideTheTableIsPassedOver) {
  if (!Make(absl::StrCat(kRows, "notes = book.create_sheet('Notes')\n",
                         "notes.append(['Operator', 'N.N.'])\n"))) {
    GTEST_SKIP() << "python3-openpyxl is not installed";
  }
  EXPECT_TRUE(InspectFile(path(), "", {}).problems.empty());
}

TEST_F(Workbook, AFormulaWithoutItsValueIsRefusedByItsCell) {
  if (!Make(absl::StrCat(kRows, "sheet['B4'] = '=B3*1.5'\n"))) {
    GTEST_SKIP() << "python3-openpyxl is not installed";
  }
  EXPECT_THAT(InspectFile(path(), "", {}).problems.front().message, HasSubstr("B4"));
}

TEST_F(Workbook, DatesStayDatesAndPercentIsAsShown) {
  if (!Make("sheet.append(['day', 'eps1 [%]', 'q [kPa]'])\n"
            "for i in range(4):\n"
            "    sheet.append([datetime.datetime(2024, 5, 1 + i), 0.01 * i, 100.0 * i])\n"
            "    sheet.cell(sheet.max_row, 2).number_format = '0.00%'\n")) {
    GTEST_SKIP() << "python3-openpyxl is not installed";
  }
  const InspectedFile answer = InspectFile(path(), "", {});
  ASSERT_TRUE(answer.problems.empty()) << answer.problems.front().message;
  EXPECT_EQ(answer.inspection.columns[0].role, "");
  EXPECT_NEAR(answer.inspection.Values(0, "axial_strain")[3], 0.03, 1e-12);
}

TEST_F(Workbook, WhatOnlySaysThatItIsOneIsRefused) {
  std::ofstream(path()) << "PK\x03\x04 and nothing else";
  const auto text = campaign::SheetAsText(path(), "");
  ASSERT_FALSE(text.ok());
  EXPECT_THAT(text.status().message(),
              ::testing::AnyOf(HasSubstr("is no workbook that can be read"),
                               HasSubstr("python3-openpyxl")));
  EXPECT_FALSE(InspectFile((folder_ / "none.xlsx").string(), "", {}).problems.empty());
}

}  // namespace
}  // namespace calib::inspection
