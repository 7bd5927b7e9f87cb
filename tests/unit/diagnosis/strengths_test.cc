#include "server/diagnosis/strengths.h"

#include <gtest/gtest.h>

namespace calib::diagnosis {
namespace {

const dem::EffectInfo& Rolling() { return *dem::FindEffect("rolling_resistance"); }

TEST(Strengths, HaveTheUnitOfTheirParameterUnderTheContact) {
  for (const char* contact : {"linear", "hertz_mindlin"}) {
    const auto units = UnitsOf(Rolling(), contact);
    EXPECT_EQ(units.size(), Rolling().parameters.size());
    for (const dem::ParameterInfo& parameter : Rolling().parameters) {
      EXPECT_EQ(units.at("rolling_resistance." + parameter.name), dem::UnitFor(parameter, contact));
    }
  }
}

}  // namespace
}  // namespace calib::diagnosis
