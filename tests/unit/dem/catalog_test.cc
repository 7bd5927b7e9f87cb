#include "dem/registry/catalog.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

#include "dem/lab_tests/shared/element_test.h"
#include "dem/lab_tests/shared/gravity_test.h"

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
    EXPECT_FALSE(e.reference.empty());
  }
}

TEST(Catalog, RaysLeaveTheNullByAdmissibleSteps) {
  const ReferenceState state{.pressure = 2e5, .diameter = 3e-4, .modulus = 1e9};
  for (const EffectInfo& e : Effects()) {
    const std::string contact = e.contacts.empty() ? "hertz_mindlin" : e.contacts.front();
    ASSERT_FALSE(e.rays.empty()) << e.name;
    for (const StrengthRay& ray : e.rays) {
      EXPECT_LT(0, ray.steps[0]) << e.name;
      EXPECT_LT(ray.steps[0], ray.steps[1]) << e.name;
      const auto off = ParametersOnRay(e, ray, 0, contact, state);
      const std::string dotted = e.name + "." + ray.parameter;
      const auto* info = FindParameter(contact, std::vector{e.name}, dotted);
      ASSERT_NE(info, nullptr) << dotted;
      EXPECT_EQ(off.at(dotted), NullValueOf(*info, contact)) << dotted;
      EXPECT_TRUE(RayAdmits(e, ray, ray.steps[0], contact, state)) << dotted;
      EXPECT_TRUE(RayAdmits(e, ray, ray.steps[1], contact, state)) << dotted;
      EXPECT_EQ(RayAdmits(e, ray, -ray.steps[0], contact, state), e.two_sided) << dotted;
      for (const auto& [name, value] : ParametersOnRay(e, ray, ray.steps[1], contact, state)) {
        const auto* held = FindParameter(contact, std::vector{e.name}, name);
        ASSERT_NE(held, nullptr) << name;
        EXPECT_TRUE(held->min <= value && value <= held->max) << name << " " << value;
      }
    }
    for (const ParameterInfo& p : e.parameters) {
      const DefaultPrior prior = PriorOf(p, contact, state);
      EXPECT_LT(prior.min, prior.max) << e.name << "." << p.name;
      EXPECT_LE(p.min, prior.min) << e.name << "." << p.name;
      EXPECT_GE(p.max, prior.max) << e.name << "." << p.name;
    }
    for (const std::string& test : e.excited_by) {
      EXPECT_NE(FindTest(test), nullptr) << e.name << " " << test;
    }
  }
}

TEST(Catalog, ScalesFollowPressureAndGrainSize) {
  const ReferenceState state{.pressure = 2e5, .diameter = 3e-4, .modulus = 1e9};
  const std::vector<std::string> effects = {"rolling_resistance"};
  const auto* p = FindParameter("hertz_mindlin", effects, "rolling_resistance.stiffness");
  ASSERT_NE(p, nullptr);
  EXPECT_NEAR(ScaleOf(*p, "hertz_mindlin", state), 2e5 * 2.7e-11, 1e-18);
  EXPECT_EQ(ScaleOf(*p, "linear", state), 1);
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

// The two lists by which effects say where they act.
TEST(Catalog, NamesOfTestsByKindAreComplete) {
  std::set<std::string> element;
  std::set<std::string> gravity;
  for (const TestInfo& test : Tests()) {
    if (test.needs_packing) (test.poured ? gravity : element).insert(test.name);
  }
  const std::vector<std::string> elements = ElementTestNames();
  const std::vector<std::string> gravities = GravityTestNames();
  EXPECT_EQ(std::set<std::string>(elements.begin(), elements.end()), element);
  EXPECT_EQ(std::set<std::string>(gravities.begin(), gravities.end()), gravity);
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
