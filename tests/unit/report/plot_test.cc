#include "server/report/plot/plot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "server/report/plot/axis.h"
#include "server/report/text/people_units.h"

namespace calib::report {
namespace {

using ::testing::ElementsAre;

std::vector<std::string> Labels(const Axis& axis) {
  std::vector<std::string> labels;
  for (const Tick& tick : axis.ticks()) labels.push_back(tick.label);
  return labels;
}

TEST(Axis, RoundTicksThatCoverTheRange) {
  EXPECT_THAT(Labels(Axis("", 0.03, 0.97, 5)), ElementsAre("0", "0.2", "0.4", "0.6", "0.8", "1"));
  EXPECT_THAT(Labels(Axis("", -3.4, 1.2, 5)), ElementsAre("−4", "−3", "−2", "−1", "0", "1", "2"));
  EXPECT_THAT(Labels(Axis("", 0.1, 100, 5, Axis::Scale::kLog, true)),
              ElementsAre("0.1", "1", "10", "100"));
}

TEST(Axis, SurvivesDegenerateRanges) {
  EXPECT_GT(Axis("", 5, 5).max(), 5);
  EXPECT_GT(Axis("", 0, 0).max(), 0);
  EXPECT_FALSE(Axis("", std::nan(""), 1).ticks().empty());
  EXPECT_FALSE(Axis::Covering("", {std::nan("")}).ticks().empty());
}

TEST(Plot, ABandThatTurnsBackComesInPieces) {
  Plot plot({}, Axis("x", 0, 4), Axis("y", 0, 2));
  const std::vector<double> x = {0, 1, 2, 3, 2, 1};
  plot.AddBand(x, std::vector<double>(6, 0), std::vector<double>(6, 1));
  const std::string svg = plot.Svg("title <1>", "description");
  const std::size_t first = svg.find("<polygon");
  ASSERT_NE(first, std::string::npos);
  EXPECT_NE(svg.find("<polygon", first + 1), std::string::npos);
  EXPECT_NE(svg.find("title &lt;1&gt;"), std::string::npos);
}

TEST(PeopleUnits, ChooseWhatReadsWell) {
  EXPECT_EQ(NumberWithUnit(2e5, "mean_stress", "Pa"), "200 kPa");
  EXPECT_EQ(NumberWithUnit(4.1e9, "young_modulus", "Pa"), "4.1 GPa");
  EXPECT_EQ(NumberWithUnit(0.0123, "axial_strain", "1"), "1.23 %");
  EXPECT_EQ(NumberWithUnit(M_PI / 6, "friction_angle", "rad"), "30 deg");
  EXPECT_EQ(NumberWithUnit(0.5, "poisson_ratio", "1"), "0.5");
  EXPECT_EQ(Number(std::nan("")), "–");
  EXPECT_EQ(Duration(4000), "1 h 6 min");
  EXPECT_EQ(NameForPeople("rolling_resistance.friction"), "rolling resistance: friction");
}

}  // namespace
}  // namespace calib::report
