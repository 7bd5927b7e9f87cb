#include "server/campaign/file/text/data_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace calib::campaign {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

std::vector<double> Column(const std::string& text, const std::string& column,
                           std::vector<TableProblem>& problems) {
  const DataTable table(text, {column}, problems);
  if (!problems.empty()) return {};
  return table.Column(column, problems);
}

TEST(DataFile, ReadsWhatLaboratoriesWrite) {
  for (const char* text : {
           "a b c\n1 2 3\n4 5 6\n",                               // plain
           "#\t\ta\t\tb\t\tc\n1\t2\t3\t\t\n\n4\t5\t6\t\t\t\n\n",  // header behind '#', blank
                                                                  // trailing fields
           "# made in 2018\n# a b c\n1 2 3\n4 5 6",  // the last comment is the header, no newline
                                                     // at the end
           "# a b c\n# in percent, from the archive\n1 2 3\n4 5 6\n",  // the header is not the last
                                                                       // comment
           "# note\na,b,c\n1,2,3,,\n4, 5 ,6\n",                        // commas, padding
           "\xEF\xBB\xBF\"a\",\"b\",\"c\"\r\n1,2,3\r\n4,5,6 # note\r\n",  // quotes, byte order
                                                                          // mark, CRLF, remark
       }) {
    std::vector<TableProblem> problems;
    EXPECT_THAT(Column(text, "b", problems), ElementsAre(2, 5)) << text;
    EXPECT_THAT(problems, IsEmpty()) << text;
  }
}

TEST(DataFile, SaysOnceHowASpreadsheetHasToSave) {
  for (const auto& [text, line, message] : {
           std::tuple("a;b\n1,5;2\n2,5;3\n", 1, "separates its fields by ';'"),
           std::tuple("# made; in 2018\na b\n1.5;2\n", 3, "separates its fields by ';'"),
           std::tuple("a\tb\n1.5\t2\n2,5\t3,5\n4,5\t5\n", 3, "has '2,5', a number with a comma"),
       }) {
    std::vector<TableProblem> problems;
    Column(text, "b", problems);
    ASSERT_THAT(problems, SizeIs(1)) << text;
    EXPECT_EQ(problems[0].line, line);
    EXPECT_THAT(problems[0].message, HasSubstr(message));
  }
  std::vector<TableProblem> problems;
  EXPECT_THAT(Column("a,b\n1,2\n3, 4\n5 ,6\n", "b", problems), ElementsAre(2, 4, 6));
  EXPECT_THAT(problems, IsEmpty());
}

TEST(DataFile, PointsToTheLineOfEveryBadField) {
  std::vector<TableProblem> problems;
  Column("a b\n1 2\n1 x\n1 nan\n1\n1 inf\n", "b", problems);
  ASSERT_THAT(problems, SizeIs(4));
  EXPECT_EQ(problems[0].line, 3);
  EXPECT_EQ(problems[0].message, "'x' is not a number");
  EXPECT_EQ(problems[1].line, 4);
  EXPECT_THAT(problems[1].message, HasSubstr("'nan' is not a finite number"));
  EXPECT_EQ(problems[2].line, 5);
  EXPECT_EQ(problems[2].message, "is missing: the line has 1 of 2 fields");
  EXPECT_EQ(problems[3].line, 6);
}

TEST(DataFile, CutsALongListOfProblemsShort) {
  std::string text = "a\n0\n";
  for (int i = 0; i < 100; ++i) text += "x\n";
  std::vector<TableProblem> problems;
  Column(text, "a", problems);
  ASSERT_THAT(problems, SizeIs(6));
  EXPECT_EQ(problems.back().message, "has 95 more bad fields");
}

TEST(DataFile, SuggestsTheNearestColumn) {
  std::vector<TableProblem> problems;
  Column("e_v e_z\n1 2\n", "e_zz", problems);
  ASSERT_THAT(problems, SizeIs(1));
  EXPECT_EQ(problems[0].message, "is not a column of this file; did you mean 'e_z'?");
}

TEST(DataFile, RefusesFilesWithoutRowsOrHeader) {
  for (const auto& [text, message] : std::vector<std::pair<std::string, std::string>>{
           {"", "holds no rows of numbers"},
           {"a b\n", "holds no rows of numbers"},
           {"1 2\n3 4\n", "has no header line above the first row that names the columns"},
           {"a b\n1 2 3\n", "has 3 fields, but the header in line 1 names 2 columns"}}) {
    std::vector<TableProblem> problems;
    Column(text, "a", problems);
    ASSERT_THAT(problems, SizeIs(1)) << text;
    EXPECT_EQ(problems[0].message, message);
  }
}

}  // namespace
}  // namespace calib::campaign
