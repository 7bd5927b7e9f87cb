#include "server/report/text/text_table.h"

#include <gtest/gtest.h>

namespace calib::report {
namespace {

TEST(TextTable, AlignsByCharactersNotBytes) {
  TextTable table({"<name", "± sd"});
  table.AddRow({"µ", "1"});
  table.AddRow({"modulus", "22.5"});
  EXPECT_EQ(table.ToString(),
            "name     ± sd\n"
            "µ           1\n"
            "modulus  22.5\n");
}

TEST(TextTable, EmptyWithoutRows) { EXPECT_EQ(TextTable({"a", "b"}).ToString(), ""); }

TEST(TextTable, NamesCannotPaintOnTheTerminal) {
  TextTable table({"<name"});
  table.AddRow({"\x1b[31mred\n"});
  EXPECT_EQ(table.ToString().find('\x1b'), std::string::npos);
  table.AddRow({std::string(100, 'x')});
  EXPECT_LT(table.ToString().size(), 200U);
}

}  // namespace
}  // namespace calib::report
