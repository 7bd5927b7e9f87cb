#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "server/inspection/inspect_file.h"
#include "tests/unit/inspection/tables.h"

namespace calib::inspection {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

std::string ProblemOf(const std::string& bytes) {
  std::vector<campaign::TableProblem> problems;
  Inspect("d.csv", bytes, {}, problems);
  return problems.empty() ? "" : problems.front().message;
}

TEST(InspectionBadInput, WhatIsNoTableIsRefusedInASentence) {
  EXPECT_THAT(ProblemOf(""), HasSubstr("is empty"));
  EXPECT_THAT(ProblemOf("\n \n"), HasSubstr("is empty"));
  EXPECT_THAT(ProblemOf(std::string("\x7F"
                                    "ELF\0\0\x02\x01\x05 a",
                                    11)),
              HasSubstr("zero bytes"));
  EXPECT_THAT(ProblemOf("only words\nand no numbers\n"), HasSubstr("holds no rows of numbers"));
  EXPECT_THAT(ProblemOf("a b\n1 2 3\n4 5 6\n"), HasSubstr("has 3 fields"));
}

TEST(InspectionBadInput, AFileOfTwoGigabytesIsNotRead) {
  const fs::path path = fs::temp_directory_path() / "calib-inspection-2gb.csv";
  std::ofstream(path) << "eps q\n0 1\n";
  std::error_code error;
  fs::resize_file(path, std::uintmax_t{2} << 30, error);  // sparse
  if (error) GTEST_SKIP() << "no sparse file can be made in " << path;
  const InspectedFile answer = InspectFile(path.string(), "", {});
  fs::remove(path);
  ASSERT_EQ(answer.problems.size(), 1U);
  EXPECT_THAT(answer.problems.front().message, HasSubstr("2048 MB"));
}

TEST(InspectionBadInput, AColumnOfDatesIsNoQuantity) {
  const Inspection inspection =
      InspectText("time,eps1[%],q[kPa]\n2024-05-01,0,0\n2024-05-02,1,90\n2024-05-03,2,120\n");
  ASSERT_EQ(inspection.columns.size(), 3U) << inspection.file;
  EXPECT_EQ(inspection.columns[0].role, "");
  EXPECT_THAT(inspection.columns[0].evidence, ::testing::Contains(HasSubstr("dates")));
  EXPECT_NE(inspection.Find("axial_strain"), nullptr);
}

TEST(InspectionBadInput, TwoColumnsOfOneNameAreNotUsed) {
  const Inspection inspection = InspectText("eps1[%],q[kPa],q[kPa]\n0,0,1\n1,90,5\n2,120,9\n");
  EXPECT_EQ(inspection.Find("deviatoric_stress"), nullptr);
  EXPECT_TRUE(Says(inspection, FindingKind::kAmbiguous, "both called"));
}

TEST(InspectionBadInput, MeaningsAreCheckedAsTheyAreRead) {
  for (const char* text : {"q", "=q", "q=", "q=deviator_stress", "q=deviatoric_stress[mm]",
                           "q=deviatoric_stress[wat]"}) {
    std::string problem;
    EXPECT_FALSE(ReadSaidMeaning(text, problem)) << text;
    EXPECT_FALSE(problem.empty()) << text;
  }
}

TEST(InspectionBadInput, HostileNamesStayText) {
  const Inspection inspection =
      InspectText("\"<script>\",\"eps1[%]\",q[kPa]\n0,0,0\n5,1,90\n7,2,120\n");
  EXPECT_EQ(inspection.columns[0].name, "<script>");
  EXPECT_EQ(inspection.columns[0].role, "");
}

}  // namespace
}  // namespace calib::inspection
