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

TEST(Strengths, OutsideTheRangeOfTheCatalogueIsSaid) {
  dem::EffectInfo effect;
  effect.name = "crushing";
  effect.parameters.resize(2);
  effect.parameters[0].name = "strength";
  effect.parameters[0].unit = "Pa";
  effect.parameters[0].min = 0;
  effect.parameters[0].min_open = true;
  effect.parameters[0].max = 2e6;
  effect.parameters[1].name = "modulus";
  effect.parameters[1].max = 10;
  EXPECT_EQ(WhyNotAdmissible(effect, "linear", {{"crushing.strength", 2e6}}), "");
  EXPECT_EQ(WhyNotAdmissible(effect, "linear", {{"crushing.strength", 3.1e6}}),
            "crushing.strength would have to be 3.1 MPa, not within its range (up to 2 MPa)");
  EXPECT_EQ(WhyNotAdmissible(effect, "linear", {{"crushing.strength", 0.0}}),
            "crushing.strength would have to be 0 Pa, not within its range (from 0 Pa)");
  EXPECT_EQ(WhyNotAdmissible(effect, "linear", {{"crushing.modulus", 0.0}}), "") << "not open";
  EXPECT_EQ(WhyNotAdmissible(effect, "linear", {{"young_modulus", -1.0}}), "");
}

TEST(Strengths, BeyondThePriorOfAnExtensionIsSaid) {
  dem::EffectInfo effect;
  effect.name = "damping";
  effect.parameters.resize(1);
  effect.parameters[0].name = "ratio";
  effect.parameters[0].null_value = 0;
  const std::map<std::string, dem::DefaultPrior> priors = {
      {"damping.ratio", {.kind = "log_uniform", .min = 0.01, .max = 1}}};
  const auto why = [&](double value) {
    return WhyBeyondPrior(priors, effect, "linear", {{"damping.ratio", value}});
  };
  EXPECT_EQ(why(0.5), "");
  EXPECT_EQ(why(0.001), "") << "weaker than the prior: an extension sees more";
  EXPECT_EQ(why(3), "damping.ratio would have to be 3, beyond the prior of an extension (up to 1)");
  EXPECT_EQ(why(-0.5),
            "damping.ratio would have to be -0.5, beyond the prior of an extension (from 0.01)");
  EXPECT_EQ(WhyBeyondPrior(priors, effect, "linear", {{"young_modulus", 7}}), "");
}

}  // namespace
}  // namespace calib::diagnosis
