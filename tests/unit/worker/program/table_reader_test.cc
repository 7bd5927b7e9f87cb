#include "worker/program/table_reader.h"

#include <gtest/gtest.h>

namespace calib::worker {
namespace {

TableReader Reader(int load_steps = 2) {
  v1::ProgramTable table;
  table.set_file("out.csv");
  const auto add = [&table](const char* name, const char* column, double factor) {
    v1::ProgramColumn& added = *table.add_columns();
    added.set_name(name);
    added.set_column(column);
    added.set_factor(factor);
  };
  add("q", "s1", 1000);
  add("p", "mean", 1);
  add("extra", "t", 1);
  return {table, {"p", "q"}, load_steps};
}

std::string FailureOfTable(const std::string& text) {
  TableReader reader = Reader();
  reader.Add(text);
  return reader.end().has_value() && reader.end()->kind == AnswerEnd::Kind::kFailed
             ? reader.end()->reason
             : "";
}

TEST(TableReader, RowsAreLoadStepsAndUnitsAreConverted) {
  for (const std::string text :
       {"mean,s1,unused,t\n1,2,x,3\n4,5,,6\n",
        "# mean s1 unused t\n\n1 2 x 3\r\n# later\n 4\t5  x 6\n",
        "#\tTime averaged\n# mean s1 unused t\n1 2 x 3\n4 5 x 6\n",
        "\"mean\", \"s1\", unused, t\r\n+1, 2.0e0, x, 3\r\n4., 5, x, 6\r\n"}) {
    for (const std::size_t size : {text.size(), std::size_t{1}, std::size_t{3}}) {
      TableReader reader = Reader();
      for (std::size_t at = 0; at < text.size(); at += size) reader.Add(text.substr(at, size));
      const auto states = reader.TakeStates();
      ASSERT_EQ(states.size(), 2U) << text;
      EXPECT_EQ(states[0].values(0), 1);
      EXPECT_EQ(states[0].values(1), 2000);
      EXPECT_EQ(states[1].others().at("extra"), 6);
      EXPECT_TRUE(reader.states().complete());
    }
  }
}

TEST(TableReader, ARowThatIsNotWholeWaits) {
  TableReader reader = Reader();
  reader.Add("mean s1 t\n1 2 3\n1 2 3");
  EXPECT_EQ(reader.TakeStates().size(), 1U);
  reader.Add("4\n");
  EXPECT_EQ(reader.TakeStates().at(0).others().at("extra"), 34);
  TableReader last = Reader();
  last.Add("mean s1 t\n1 2 3\n1 2 3");
  last.EndOfInput();
  EXPECT_EQ(last.TakeStates().size(), 2U);
}

TEST(TableReader, DivergesAtNan) {
  for (const char* cell : {"nan", "-NaN", "inf", "Infinity", "null", "None", ""}) {
    TableReader reader = Reader();
    reader.Add(std::string("mean,s1,t\n1,") + cell + ",3\n");
    ASSERT_TRUE(reader.end().has_value()) << cell;
    EXPECT_EQ(reader.end()->kind, AnswerEnd::Kind::kDiverged);
    EXPECT_NE(reader.end()->reason.find("q is "), std::string::npos) << reader.end()->reason;
  }
}

TEST(TableReader, FailsWithASentence) {
  EXPECT_EQ(FailureOfTable("mean,s2,t\n"),
            "out.csv has no column s1; its first line has: mean, s2, t");
  EXPECT_EQ(FailureOfTable("1 2 3\n"), "out.csv has no column s1; its first line has: 1, 2, 3");
  EXPECT_EQ(FailureOfTable("mean s1 t\n1 2\n"), "row 0 of out.csv has 2 cells, its header has 3");
  EXPECT_EQ(FailureOfTable("mean s1 t\n1 x 3\n"), "q is no number at load step 0");
  EXPECT_EQ(FailureOfTable("mean s1 t\n1 2 3\n1 2 3\n1 2 3\n"),
            "load step 2 is beyond the last, 1");
  EXPECT_EQ(FailureOfTable(std::string(2 << 20, 'x')), "a line of out.csv is longer than 1 MiB");
}

}  // namespace
}  // namespace calib::worker
