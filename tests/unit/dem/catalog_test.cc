#include "dem/registry/catalog.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

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

// Effects ask for traits; the registry finds the tests that have them.
TEST(Catalog, EffectsAreShownByTheTestsThatHaveTheirTraits) {
  const auto shown = [](const std::string& effect) {
    const std::vector<std::string>& names = FindEffect(effect)->excited_by;
    return std::set<std::string>(names.begin(), names.end());
  };
  std::set<std::string> cell;
  std::set<std::string> walls;
  for (const TestInfo& test : Tests()) {
    if (InPeriodicCell(test)) cell.insert(test.name);
    if (test.has_walls) walls.insert(test.name);
  }
  EXPECT_EQ(shown("initial_density"), cell);
  EXPECT_EQ(shown("wall_friction"), walls);
  EXPECT_EQ(cell, (std::set<std::string>{"triaxial_drained", "triaxial_undrained", "oedometric",
                                         "isotropic", "simple_shear"}));
  EXPECT_EQ(walls, (std::set<std::string>{"angle_of_repose", "silo_discharge", "rotating_drum",
                                          "calibration_device", "transfer_chute", "shaken_box",
                                          "collision"}));
  EXPECT_EQ(shown("membrane_stiffness"),
            (std::set<std::string>{"triaxial_drained", "triaxial_undrained"}));
  EXPECT_EQ(shown("load_cell_error"),
            (std::set<std::string>{"triaxial_drained", "triaxial_undrained", "oedometric"}));
  EXPECT_EQ(shown("twisting_resistance").count("shaken_box"), 0U);
  EXPECT_TRUE(shown("rolling_resistance").empty());  // of every test
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
