#include "server/campaign/file/text/quantity.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace calib::campaign {
namespace {

using ::testing::HasSubstr;

double Si(const std::string& text, const std::string& unit) {
  const auto value = ParseQuantity(text, unit);
  EXPECT_TRUE(value.ok()) << text << ": " << value.status();
  return value.value_or(std::nan(""));
}

std::string Error(const std::string& text, const std::string& unit) {
  const auto value = ParseQuantity(text, unit);
  EXPECT_FALSE(value.ok()) << text;
  return std::string(value.status().message());
}

TEST(Quantity, ConvertsToSi) {
  EXPECT_DOUBLE_EQ(Si("0.2 MPa", "Pa"), 2e5);
  EXPECT_DOUBLE_EQ(Si("1e8 Pa", "Pa"), 1e8);
  EXPECT_DOUBLE_EQ(Si("1e8Pa", "Pa"), 1e8);
  EXPECT_DOUBLE_EQ(Si("45 deg", "rad"), std::numbers::pi / 4);
  EXPECT_DOUBLE_EQ(Si("2650 kg/m^3", "kg/m^3"), 2650);
  EXPECT_DOUBLE_EQ(Si("2.65 g/cm3", "kg/m^3"), 2650);
  EXPECT_DOUBLE_EQ(Si("0.1 1/s", "1/s"), 0.1);
  EXPECT_DOUBLE_EQ(Si("0.1 percent", "1"), 1e-3);
  EXPECT_DOUBLE_EQ(Si("5 %", "1"), 0.05);
  EXPECT_DOUBLE_EQ(Si("8000 nN m/rad", "N m/rad"), 8e-6);
  EXPECT_DOUBLE_EQ(Si("8000 nN*m", "N m/rad"), 8e-6);
  EXPECT_DOUBLE_EQ(Si("120 um", "m"), 1.2e-4);
  EXPECT_DOUBLE_EQ(Si("0.5 l", "m^3"), 5e-4);
  EXPECT_DOUBLE_EQ(Si("2.65 kg/l", "kg/m^3"), 2650);
  EXPECT_DOUBLE_EQ(Si("40 ml/min", "m^3/s"), 40e-6 / 60);
  EXPECT_DOUBLE_EQ(Si("120 µm", "m"), 1.2e-4);
  EXPECT_DOUBLE_EQ(Si("50 mJ/m^2", "N/m"), 0.05);
  EXPECT_DOUBLE_EQ(Si("+3", "Pa"), 3);
  EXPECT_DOUBLE_EQ(Si(" -2.5e-1 ", "1"), -0.25);
  EXPECT_EQ(Si(".inf", "1"), HUGE_VAL);
}

TEST(Quantity, RefusesAnotherKindOfUnit) {
  EXPECT_EQ(Error("3e8 deg", "Pa"),
            "deg is an angle (deg, rad), expected a pressure (Pa, kPa, MPa, GPa)");
  EXPECT_THAT(Error("3 MPa", "rad"), HasSubstr("expected an angle"));
  EXPECT_THAT(Error("3 deg", "1"), HasSubstr("expected a dimensionless number"));
  EXPECT_THAT(Error("3 percent", "rad"), HasSubstr("expected an angle"));
}

TEST(Quantity, RefusesWhatIsNoNumberOrUnit) {
  EXPECT_THAT(Error("lots", "Pa"), HasSubstr("'lots' is not a number"));
  EXPECT_THAT(Error("", "Pa"), HasSubstr("is not a number"));
  EXPECT_THAT(Error("nan", "Pa"), HasSubstr("is not a number"));
  EXPECT_EQ(Error("0,2 MPa", "Pa"),
            "'0,2 MPa' has a comma in its number: write a decimal point, expected a pressure (Pa, "
            "kPa, MPa, GPa)");
  EXPECT_THAT(Error("1e999 Pa", "Pa"), HasSubstr("too large"));
  EXPECT_THAT(Error("3 MPA", "Pa"), HasSubstr("unknown unit 'MPA'; did you mean 'MPa'?"));
  EXPECT_THAT(Error("3 kg/m^x", "kg/m^3"), HasSubstr("exponent"));
  EXPECT_THAT(Error("3 furlong", "m"), HasSubstr("unknown unit 'furlong'"));
}

TEST(Quantity, NamesUnknownCombinations) {
  EXPECT_EQ(SiName(ParseUnit("nN*m/rad")->dimension), "N m/rad");
  EXPECT_EQ(SiName(ParseUnit("GPa")->dimension), "Pa");
  EXPECT_EQ(SiName(ParseUnit("percent")->dimension), "1");
  EXPECT_EQ(SiName(ParseUnit("g^2 m")->dimension), "kg^2 m");
}

}  // namespace
}  // namespace calib::campaign
