#include "server/report/text/terminal_plot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "absl/strings/str_split.h"

namespace calib::report {
namespace {

int Signs(const std::string& line) {
  int count = 0;
  for (const char c : line) count += (static_cast<unsigned char>(c) & 0xC0) != 0x80 ? 1 : 0;
  return count;
}

TerminalCurve Parabola(const std::string& name, double scale) {
  TerminalCurve curve{.name = name};
  for (int i = 0; i <= 50; ++i) {
    curve.x.push_back(i);
    curve.y.push_back(scale * i * i);
  }
  return curve;
}

TEST(TerminalPlot, KeepsToItsWidthInEveryStyle) {
  const std::vector<TerminalCurve> curves = {Parabola("model", 1), Parabola("a long name", -0.5)};
  for (const int columns : {20, 40, 80, 200}) {
    for (const bool utf8 : {false, true}) {
      const std::string plot = TerminalPlot(curves, {.x = "axial strain [percent]", .y = "q [kPa]"},
                                            {.columns = columns, .utf8 = utf8});
      const std::vector<std::string> lines = absl::StrSplit(plot, '\n');
      for (const std::string& line : lines) {
        EXPECT_LE(Signs(line), columns) << line;
      }
    }
  }
}

TEST(TerminalPlot, IsAsciiWithoutUtf8AndHasNoEscapesWithoutColour) {
  const std::string plot = TerminalPlot({Parabola("a", 1)}, {.x = "x", .y = "y"}, {.columns = 60});
  for (const char c : plot) EXPECT_TRUE((c >= ' ' && c <= '~') || c == '\n') << int{c};
  const std::string braille =
      TerminalPlot({Parabola("a", 1)}, {.x = "x", .y = "y"}, {.columns = 60, .utf8 = true});
  EXPECT_EQ(braille.find('\033'), std::string::npos);
  EXPECT_THAT(braille, ::testing::HasSubstr("\xE2"));
}

TEST(TerminalPlot, ARisingCurveBeginsBelowAndEndsAbove) {
  const std::string plot =
      TerminalPlot({Parabola("a", 1)}, {.x = "x", .y = "y", .rows = 5}, {.columns = 30});
  const std::vector<std::string> lines = absl::StrSplit(plot, '\n');
  EXPECT_EQ(lines[1].back(), '*');                      // the top row, at its right end
  EXPECT_LT(lines[5].find('*'), 8U);                    // the lowest, at its left
  EXPECT_THAT(lines[1], ::testing::HasSubstr("2500"));  // the largest number
}

TEST(TerminalPlot, WhatIsNotFiniteIsNoPoint) {
  TerminalCurve curve = Parabola("a", 1);
  curve.y[10] = std::nan("");
  curve.y[20] = HUGE_VAL;
  EXPECT_FALSE(TerminalPlot({curve}, {.x = "x", .y = "y"}, {}).empty());
  EXPECT_TRUE(TerminalPlot({{.name = "none", .x = {1}, .y = {std::nan("")}}}, {}, {}).empty());
}

}  // namespace
}  // namespace calib::report
