#include "server/campaign/file/text/data_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

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

TEST(DataFile, ReadsWhatSpreadsheetsWriteWhereTheDecimalSignIsAComma) {
  for (const char* text : {"a;b\n1,5;2\n2,5;5,25\n", "a\tb\n1,5\t2\n2,5\t5,25\n",
                           "a b\n1,5 2\n2,5 5,25\n", "a;b\n1.5;2\n2.5;5.25\n"}) {
    std::vector<TableProblem> problems;
    EXPECT_THAT(Column(text, "b", problems), ElementsAre(2, 5.25)) << text;
    EXPECT_THAT(problems, IsEmpty()) << text;
  }
}

TEST(DataFile, ACommaThatMayMeanTwoThingsIsAskedFor) {
  for (const auto& [text, line, message] : {
           std::tuple("a\tb\n1.5\t2\n2,5\t3,5\n4,5\t5\n", 3, "has '2,5', a number with a comma"),
           std::tuple("a\tb\n1,234\t2\n5,678\t3\n", 2, "may part a fraction or thousands"),
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
  Column("a,b\n1,2\n1,x\n1,nan\n1\n1,inf\n", "b", problems);
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

// Names with blanks and units, wherever the rows show how many columns there are.
TEST(DataFile, NamesMayHoldBlanksAndUnits) {
  for (const auto& [text, column] : {
           std::pair("# e (%) q (kPa) u (kPa)\n0 1 10\n1 50 20\n", "q"),
           std::pair("# e (%) q (kPa) u (kPa)\n0 1 10\n1 50 20\n", "q (kPa)"),
           std::pair("eps1  Void ratio   q    p\n0\t0.90\t1\t100\n0.4\t0.89\t50\t117\n", "q"),
           std::pair("** eps1        Void ratio    q    eta = q/p  \r\n\r\n0\t0.8\t1\t0\r\n"
                     "1\t0.8\t50\t1\r\n",
                     "q"),
           std::pair("eps1   u   q\n[%]   [kPa]  [kPa] \n\n0 1 1\n1 2 50\n", "q"),
           std::pair("time_min\teps a\tq\n0\t\t1\n1\t0.1\t50\n", "q"),
           std::pair("a[%],\"q\",\"note, with comma\"\n\"0\",\"1\",\"x\"\n\"1\",\"50\",\"\"\n",
                     "q"),
       }) {
    std::vector<TableProblem> problems;
    EXPECT_THAT(Column(text, column, problems), ElementsAre(1, 50)) << text;
    EXPECT_THAT(problems, IsEmpty()) << text << (problems.empty() ? "" : problems[0].message);
  }
}

TEST(DataFile, ARowThatNoReadingExplainsIsRefusedWithBothCounts) {
  for (const auto& [text, message] : {
           std::pair("e q u\n0 1 10\n1 20\n",
                     "has 2 fields, but the header in line 1 names 3 columns"),
           std::pair("axial strain q kPa\n0 1\n", "has 2 fields, but the header in line 1 names 4"),
           std::pair("stress, kPa,strain\n1,2\n", "has 2 fields, but the header in line 1 names 3"),
       }) {
    std::vector<TableProblem> problems;
    Column(text, "q", problems);
    ASSERT_THAT(problems, SizeIs(1)) << text;
    EXPECT_THAT(problems[0].message, HasSubstr(message)) << text;
    EXPECT_EQ(problems[0].kind, "columns");
  }
}

TEST(DataFile, AMissingCellIsNoNumberAndNoProblem) {
  for (const char* text :
       {"a,b\n1,2\n2,NaN\n3,4\n", "a\tb\n1\t2\n2\t\n3\t4\n", "a;b\n1;2\n2\n3;4\n",
        "a b\n1 2\n2 NA\n3 4\n", "a,b\n1,2\n2,#N/A\n3,4\n"}) {
    std::vector<TableProblem> problems;
    const DataTable table(text, {"b"}, problems);
    const auto b = table.ColumnWithGaps("b", problems);
    ASSERT_THAT(problems, IsEmpty()) << text << problems.size();
    ASSERT_THAT(b, SizeIs(3)) << text;
    EXPECT_TRUE(b[0] == 2 && std::isnan(b[1]) && b[2] == 4) << text;
    table.Column("b", problems);
    EXPECT_THAT(problems, SizeIs(1)) << text;
  }
}

TEST(DataFile, FormatSaysWhatIsNotFound) {
  std::vector<TableProblem> problems;
  const std::string sections =
      "# == A ==\nid,kind,n\nT1,drained,2\n\n# == B ==\nid,e[%],q[kPa]\nT1,0,1\nT1,1,\nT2,0,7\n";
  TableFormat of_one;
  of_one.where = {{"id", "T1"}};
  const DataTable where(sections, of_one, {"q"}, problems);
  ASSERT_THAT(problems, IsEmpty()) << problems.size();
  EXPECT_EQ(where.rows(), 2U);
  EXPECT_EQ(where.ColumnWithGaps("q", problems)[0], 1);
  TableFormat without_header;
  without_header.header = false;
  without_header.first_row = 2;
  without_header.last_row = 3;
  const DataTable numbered("1 2\n3 4\n5 6\n", without_header, {"2"}, problems);
  EXPECT_THAT(numbered.Column("2", problems), ElementsAre(4, 6));
  TableFormat below;
  below.skip = 2;
  below.missing = {"-"};
  const DataTable skipped("made by 12 34\n7 8\na b\nm kPa\n1 -\n3 4\n", below, {"b"}, problems);
  ASSERT_THAT(problems, IsEmpty()) << problems.size();
  EXPECT_EQ(skipped.ColumnWithGaps("b", problems)[1], 4);
  EXPECT_THAT(problems, IsEmpty());
  of_one.where = {{"id", "T9"}};
  const DataTable none(sections, of_one, {"q"}, problems);
  ASSERT_THAT(problems, SizeIs(1));
  EXPECT_EQ(problems[0].message, "holds no rows of numbers with id T9");
}

TEST(DataFile, ReadsOtherEncodingsAndNamesWhatIsNoText) {
  const std::string plain = "a;b\r\n1,5;2\r\n2,5;3\r\n";
  std::string wide = "\xFF\xFE";
  for (const char c : plain) wide += {c, '\0'};
  for (const std::string& bytes : {wide, wide.substr(2), std::string("a \xB0;b\n1;2\n2;3\n")}) {
    std::vector<TableProblem> problems;
    EXPECT_THAT(Column(bytes, "b", problems), ElementsAre(2, 3));
    EXPECT_THAT(problems, IsEmpty());
  }
  for (const std::string& bytes :
       {std::string("PK\x03\x04 sheet"), std::string("a b\n1 \0\0\0 2\n", 11)}) {
    std::vector<TableProblem> problems;
    Column(bytes, "b", problems);
    ASSERT_THAT(problems, SizeIs(1));
    EXPECT_EQ(problems[0].kind, "encoding");
  }
}

// The names of the columns, or what is wrong.
std::string NamesOf(const std::string& text) {
  std::vector<TableProblem> problems;
  const DataTable table(text, {}, problems);
  if (!problems.empty()) return problems[0].message;
  std::string names;
  for (const std::string& name : table.columns()) names += "|" + name;
  return names;
}

TEST(DataFile, NamesWithBlanksEndWithTheirUnits) {
  EXPECT_EQ(NamesOf("Axial strain (%) Stress ratio [-] p (kPa)\n0 1 100\n0.4 1.5 117\n"),
            "|Axial strain (%)|Stress ratio [-]|p (kPa)");
  EXPECT_EQ(NamesOf("# Axial strain (%) q\n0 1\n0.4 1.5\n"), "|Axial strain (%)|q");
  EXPECT_EQ(NamesOf("Axial strain[%] Stress ratio\n0 1 2\n0.4 1.5 2\n"),
            "|Axial strain[%]|Stress|ratio");
}

TEST(DataFile, QuotesHoldNamesTogetherWhereBlanksPartThem) {
  EXPECT_EQ(NamesOf("\"Axial strain\" \"Stress ratio\" p\n0 1 100\n0.4 1.5 117\n"),
            "|Axial strain|Stress ratio|p");
}

TEST(DataFile, QuotedNumbersMayHaveADecimalComma) {
  std::vector<TableProblem> problems;
  const DataTable table("\"a\",\"b\"\n\"0,0\",\"1,05\"\n\"0,4\",\"1,5\"\n", {}, problems);
  EXPECT_EQ(table.Column("b", problems), (std::vector<double>{1.05, 1.5}));
  EXPECT_TRUE(problems.empty());
}

}  // namespace
}  // namespace calib::campaign
