#include "dem/catalog/catalog.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

namespace calib::dem {
namespace {

TEST(Catalog, ListsWhatTheEngineRuns) {
  EXPECT_NE(FindContact("hertz_mindlin"), nullptr);
  EXPECT_NE(FindContact("linear"), nullptr);
  EXPECT_NE(FindEffect("rolling_resistance"), nullptr);
  EXPECT_NE(FindEffect("twisting_resistance"), nullptr);
  EXPECT_NE(FindTest("isotropic"), nullptr);
  EXPECT_NE(FindTest("oedometric"), nullptr);
  EXPECT_NE(FindTest("triaxial_drained"), nullptr);
  EXPECT_EQ(FindContact("hertz_mindln"), nullptr);
}

TEST(Catalog, EveryObservableOfATestIsDescribed) {
  for (const TestInfo& test : Tests()) {
    for (const std::string& name : test.observables) {
      EXPECT_NE(FindObservable(name), nullptr) << test.name << " " << name;
    }
    EXPECT_NE(FindObservable(test.control), nullptr) << test.name;
  }
}

TEST(Catalog, DefaultPriorsLieInTheAdmissibleRange) {
  const auto check = [](const std::vector<ParameterInfo>& parameters) {
    for (const ParameterInfo& p : parameters) {
      EXPECT_LE(p.min, p.default_prior.min) << p.name;
      EXPECT_LT(p.default_prior.min, p.default_prior.max) << p.name;
      EXPECT_GE(p.max, p.default_prior.max) << p.name;
      EXPECT_FALSE(p.unit.empty()) << p.name;
      EXPECT_FALSE(p.description.empty()) << p.name;
    }
  };
  for (const ContactInfo& c : Contacts()) {
    check(c.parameters);
    EXPECT_FALSE(c.reference.empty());
  }
  for (const EffectInfo& e : Effects()) {
    check(e.parameters);
    EXPECT_EQ(e.kind, "contact");
    EXPECT_FALSE(e.reference.empty());
  }
}

TEST(Catalog, RollingStiffnessHasTheUnitOfItsContactLaw) {
  const std::vector<std::string> effects = {"rolling_resistance"};
  const ParameterInfo* p = FindParameter("linear", effects, "rolling_resistance.stiffness");
  ASSERT_NE(p, nullptr);
  EXPECT_EQ(UnitFor(*p, "linear"), "1");
  EXPECT_EQ(UnitFor(*p, "hertz_mindlin"), "N m/rad");
}

TEST(Catalog, ParametersBelongToTheModelThatHasThem) {
  EXPECT_NE(FindParameter("linear", {}, "friction_angle"), nullptr);
  EXPECT_EQ(FindParameter("linear", {}, "rolling_resistance.stiffness"), nullptr);
  EXPECT_EQ(FindParameter("nothing", {}, "friction_angle"), nullptr);
}

TEST(Catalog, TextNamesEveryEntryOnce) {
  const std::string text = CatalogText();
  for (const TestInfo& test : Tests()) {
    EXPECT_THAT(text, testing::HasSubstr("test " + test.name));
  }
  EXPECT_THAT(text, testing::HasSubstr("engine " + EngineVersion()));
  EXPECT_EQ(text, CatalogText());
}

}  // namespace
}  // namespace calib::dem
