#include "server/ctl/catalog_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

namespace calib::ctl {
namespace {

using ::testing::HasSubstr;

// Last word of the parameter's row.
std::string DefaultIn(const std::string& text, const std::string& parameter) {
  const std::size_t begin = text.find("\n  " + parameter + " ");
  const std::string row = text.substr(begin + 1, text.find('\n', begin + 1) - begin - 1);
  return row.substr(row.find_last_of(' ') + 1);
}

TEST(CatalogText, ScalesAreProducts) {
  EXPECT_EQ(ScaleText({}), "1");
  EXPECT_EQ(ScaleText({.factor = 0.01}), "0.01");
  EXPECT_EQ(ScaleText({.pressure = 1, .diameter = 3}), "p d^3");
  EXPECT_EQ(ScaleText({.factor = 0.01, .pressure = -1, .modulus = 1}), "0.01 p^-1 E");
}

TEST(CatalogText, AnEffectSaysWhereItActsAndInWhatUnitsItIsStrong) {
  const std::string text = EffectText(*dem::FindEffect("membrane_stiffness"));
  EXPECT_THAT(text, HasSubstr("\n  excited by: triaxial_drained, triaxial_undrained\n"));
  EXPECT_THAT(text, HasSubstr("scaled default prior log_uniform 0.01 .."));
  EXPECT_THAT(text, HasSubstr(" 10 times p\n"));
}

TEST(CatalogText, ATestSaysWhatItReadsAndWhatItChooses) {
  const std::string text = TestText(*dem::FindTest("silo_discharge"));
  EXPECT_THAT(text, HasSubstr("\n    mass_flow_rate [kg/s] through an outlet\n"));
  EXPECT_EQ(DefaultIn(text, "silo_width"), "chosen");
  EXPECT_EQ(DefaultIn(text, "drag"), "0");
  EXPECT_EQ(DefaultIn(text, "flat"), "0");
  EXPECT_EQ(DefaultIn(text, "thickness"), "0") << "without one grains are spheres";
  EXPECT_THAT(TestText(*dem::FindTest("isotropic")), HasSubstr("Fails when"));
}

// Descriptions; the columns of a table keep together.
TEST(CatalogText, LinesArePrintable) {
  for (const dem::TestInfo& test : dem::Tests()) {
    std::istringstream lines(TestText(test));
    for (std::string line; std::getline(lines, line);) {
      EXPECT_TRUE(line.size() <= 100 || line.find("  ", 4) != std::string::npos) << line;
    }
  }
}

}  // namespace
}  // namespace calib::ctl
