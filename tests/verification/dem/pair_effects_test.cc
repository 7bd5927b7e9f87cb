// Effects whose parameters differ between pairs of materials, against their closed forms.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <string>
#include <vector>

#include "dem/contact/materials.h"
#include "dem/dynamics/contact_model.h"
#include "dem/registry/catalog.h"
#include "dem/registry/model_parameters.h"
#include "dem/registry/registry.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kRadius = 0.01;
constexpr double kOverlap = 1e-6;

/// Grains of 50 GPa, steel and rubber besides, with these effects and values.
Model Three(std::vector<std::string> effects, const std::map<std::string, double>& values) {
  Model model;
  model.contact = "hertz_mindlin";
  model.density = 2500;
  model.materials = {"steel", "rubber"};
  model.effects = std::move(effects);
  model.parameters = {{"young_modulus", 5e10},       {"poisson_ratio", 0.2},
                      {"friction_coefficient", 0.5}, {"steel.young_modulus", 2e11},
                      {"steel.poisson_ratio", 0.3},  {"rubber.young_modulus", 5e7},
                      {"rubber.poisson_ratio", 0.48}};
  model.parameters.insert(values.begin(), values.end());
  return model;
}

/// Two touching grains in every lane, the materials of lane k in turn all nine pairs, the second
/// turning about y and about the normal, x.
struct Pairs {
  ContactBlock block{};

  explicit Pairs(const Model& model, double overlap = kOverlap) {
    const ContactModel contact = ContactModelOf(model);
    block.mixed = true;
    block.count = kBlock;
    block.dt = 1e-3;
    for (int k = 0; k < kBlock; ++k) {
      block.radius_i[k] = block.radius_j[k] = kRadius;
      block.dx[k] = 2 * kRadius - overlap;
      block.wjx[k] = 3;
      block.wjy[k] = 2;
      block.materials[k] = k % contact.materials()->pairs();
    }
    block.sliding_friction = contact.sliding_friction();
    contact.Evaluate(block);
  }
};

constexpr int kGrains = 0, kSteel = 1, kRubber = 2;
constexpr int Lane(int a, int b) { return 3 * a + b; }

/// E* of two materials [Johnson 1985, Eq. 4.20c].
double Hertz(const Model& model, int a, int b) {
  const auto compliance = [&](int material) {
    const std::string prefix =
        std::vector<std::string>{"", "steel.", "rubber."}[static_cast<std::size_t>(material)];
    const double nu = model.parameters.at(prefix + "poisson_ratio");
    return (1 - nu * nu) / model.parameters.at(prefix + "young_modulus");
  };
  return 1 / (compliance(a) + compliance(b));
}

double HertzForce(const Model& model, int a, int b) {
  return 4.0 / 3.0 * Hertz(model, a, b) * std::sqrt(0.5 * kRadius) * std::pow(kOverlap, 1.5);
}

TEST(PairEffects, RollingAndTwistingMomentsAreThoseOfThePair) {
  const Model model = Three({"rolling_resistance", "twisting_resistance"},
                            {{"rolling_resistance.stiffness_ratio", 1},
                             {"rolling_resistance.friction", 0.1},
                             {"steel-grains.rolling_resistance.friction", 0.02},
                             {"rubber-rubber.rolling_resistance.friction", 0.4},
                             {"grains-rubber.rolling_resistance.stiffness", 1e-9},
                             {"twisting_resistance.stiffness", 1e5},
                             {"twisting_resistance.friction", 0.05},
                             {"steel-steel.twisting_resistance.friction", 0}});
  const Pairs pairs(model);
  const auto limit = [&](int a, int b, double friction) {
    return friction * HertzForce(model, a, b) * kRadius;
  };
  // Both relative rotations are far beyond the limits, but for the pair of 1e-9 N m/rad.
  struct Case {
    int a, b;
    double rolling, twisting;
  };
  for (const Case& c : std::vector<Case>{{kGrains, kGrains, 0.1, 0.05},
                                         {kGrains, kSteel, 0.02, 0.05},
                                         {kSteel, kGrains, 0.02, 0.05},
                                         {kSteel, kSteel, 0.1, 0},
                                         {kSteel, kRubber, 0.1, 0.05},
                                         {kRubber, kRubber, 0.4, 0.05}}) {
    const int k = Lane(c.a, c.b);
    EXPECT_NEAR(std::abs(pairs.block.my[k]), limit(c.a, c.b, c.rolling),
                1e-11 * limit(c.a, c.b, c.rolling))
        << c.a << c.b;
    EXPECT_NEAR(std::abs(pairs.block.mx[k]), limit(c.a, c.b, c.twisting),
                1e-11 * limit(c.a, c.b, c.twisting))
        << c.a << c.b;
  }
  const double rolled = 2 * pairs.block.dt;
  EXPECT_NEAR(std::abs(pairs.block.my[Lane(kRubber, kGrains)]), 1e-9 * rolled, 1e-20);
}

TEST(PairEffects, AttractionsAreThoseOfThePair) {
  const double r = 0.5 * kRadius;  // R*
  const auto expect = [](const Pairs& pairs, int a, int b, double attraction) {
    EXPECT_NEAR(pairs.block.attraction[Lane(a, b)], attraction, 1e-12 * std::abs(attraction));
  };
  const Pairs dmt(Three({"adhesion_dmt"}, {{"adhesion_dmt.work_of_adhesion", 0.1},
                                           {"grains-steel.adhesion_dmt.work_of_adhesion", 0},
                                           {"rubber-rubber.adhesion_dmt.work_of_adhesion", 2}}));
  expect(dmt, kGrains, kGrains, 2 * std::numbers::pi * 0.1 * r);
  expect(dmt, kSteel, kGrains, 0);
  expect(dmt, kRubber, kRubber, 2 * std::numbers::pi * 2 * r);
  const Pairs cohesion(
      Three({"linear_cohesion"}, {{"linear_cohesion.energy_density", 0},
                                  {"steel-rubber.linear_cohesion.energy_density", 1e6}}));
  expect(cohesion, kGrains, kSteel, 0);
  expect(cohesion, kRubber, kSteel, 2 * std::numbers::pi * 1e6 * r * kOverlap);
  const std::map<std::string, double> water = {
      {"capillary_bridges.surface_tension", 0.073},
      {"capillary_bridges.volume_ratio", 1e-3},
      {"rubber-steel.capillary_bridges.surface_tension", 0}};
  const Pairs bridges(Three({"capillary_bridges"}, water));
  expect(bridges, kSteel, kSteel, 2 * std::numbers::pi * 0.073 * kRadius);
  expect(bridges, kSteel, kRubber, 0);
  EXPECT_GT(bridges.block.holds[Lane(kSteel, kSteel)], 0);
  EXPECT_EQ(bridges.block.holds[Lane(kRubber, kSteel)], 0) << "a dry pair parts where it opens";
}

TEST(PairEffects, JkrTakesWorkAndModulusOfThePair) {
  const Model model = Three({"adhesion_jkr"}, {{"adhesion_jkr.work_of_adhesion", 0.5},
                                               {"steel-rubber.adhesion_jkr.work_of_adhesion", 3},
                                               {"grains-grains.adhesion_jkr.work_of_adhesion", 1}});
  EXPECT_THAT(MaterialProblems(model), IsEmpty());
  EXPECT_EQ(FindParameter(model, "grains-grains.adhesion_jkr.work_of_adhesion"), nullptr)
      << "stands with the model";
  const Pairs pairs(model);
  const auto expect = [&](int a, int b, double work) {
    // u = a^2/R - sqrt(2 pi W a/E), F = 4 E a^3/(3R) - sqrt(8 pi W E a^3), by bisection.
    const double e = Hertz(model, a, b);
    const double r = 0.5 * kRadius;
    double low = std::cbrt(std::numbers::pi * work * r * r / (8 * e));
    double high = 0.5 * r;
    for (int n = 0; n < 200; ++n) {
      const double c = 0.5 * (low + high);
      (c * c / r - std::sqrt(2 * std::numbers::pi * work * c / e) < kOverlap ? low : high) = c;
    }
    const double c3 = low * low * low;
    const double force = 4 * e * c3 / (3 * r) - std::sqrt(8 * std::numbers::pi * work * e * c3);
    EXPECT_NEAR(pairs.block.normal_force[Lane(a, b)], force, 1e-8 * std::abs(force)) << a << b;
  };
  expect(kSteel, kGrains, 0.5);
  expect(kRubber, kSteel, 3);
  expect(kSteel, kRubber, 3);
  expect(kRubber, kRubber, 0.5);

  const Model dry = Three({"adhesion_jkr"}, {{"adhesion_jkr.work_of_adhesion", 0.5},
                                             {"steel-grains.adhesion_jkr.work_of_adhesion", 0}});
  const Pairs some(dry);
  const double hertz = HertzForce(dry, kSteel, kGrains);
  EXPECT_NEAR(some.block.normal_force[Lane(kSteel, kGrains)], hertz, 1e-11 * hertz);
  EXPECT_EQ(some.block.holds[Lane(kGrains, kSteel)], 0);
}

// F = F_b (F_b/(p_ref d*^2))^((n - m)/m), d* = 4 R* = d.
TEST(PairEffects, ExponentIsThatOfThePair) {
  const double reference = 1e5;
  const Model model =
      Three({"hertz_nonlinearity"}, {{"hertz_nonlinearity.exponent", 1.5},
                                     {"hertz_nonlinearity.reference_pressure", reference},
                                     {"steel-rubber.hertz_nonlinearity.exponent", 2.5},
                                     {"grains-grains.hertz_nonlinearity.exponent", 1}});
  const Pairs pairs(model);
  const auto expect = [&](int a, int b, double exponent) {
    const double base = HertzForce(model, a, b);
    const double unit = reference * 4 * kRadius * kRadius;
    const double force = base * std::pow(base / unit, (exponent - 1.5) / 1.5);
    const double stiffness = exponent * force / kOverlap;
    EXPECT_NEAR(pairs.block.normal_force[Lane(a, b)], force, 1e-9 * force) << a << b;
    EXPECT_NEAR(pairs.block.normal_stiffness[Lane(a, b)], stiffness, 1e-9 * stiffness) << a << b;
  };
  expect(kGrains, kSteel, 1.5);
  expect(kSteel, kRubber, 2.5);
  expect(kRubber, kSteel, 2.5);
  expect(kGrains, kGrains, 1);
}

// tan(phi_mu) Fn (Fn/(d*^2 p_ref))^(-m).
TEST(PairEffects, FrictionFallsWithThePressureOfThePair) {
  const double reference = 1e5;
  const Model model = Three({"pressure_dependent_friction"},
                            {{"pressure_dependent_friction.exponent", 0},
                             {"pressure_dependent_friction.reference_pressure", reference},
                             {"steel-grains.pressure_dependent_friction.exponent", 0.3},
                             {"rubber-rubber.pressure_dependent_friction.exponent", -0.2}});
  const Pairs pairs(model);
  const auto expect = [&](int a, int b, double exponent) {
    const double force = HertzForce(model, a, b);
    const double limit =
        0.5 * force * std::pow(force / (4 * kRadius * kRadius * reference), -exponent);
    EXPECT_NEAR(pairs.block.sliding_limit[Lane(a, b)], limit, 1e-9 * limit) << a << b;
  };
  expect(kSteel, kSteel, 0);
  expect(kGrains, kSteel, 0.3);
  expect(kSteel, kGrains, 0.3);
  expect(kRubber, kRubber, -0.2);
}

// Loaded to twice the overlap, then unloaded to it: F_b - (kappa - 1)(F_max - F_b).
TEST(PairEffects, PlasticityIsThatOfThePair) {
  const Model model =
      Three({"contact_plasticity"}, {{"contact_plasticity.stiffness_ratio", 1},
                                     {"rubber-steel.contact_plasticity.stiffness_ratio", 1.2},
                                     {"grains-grains.contact_plasticity.stiffness_ratio", 50}});
  const ContactModel contact = ContactModelOf(model);
  Pairs pairs(model, 2 * kOverlap);
  for (double& dx : pairs.block.dx) dx = 2 * kRadius - kOverlap;
  contact.Evaluate(pairs.block);
  const auto expect = [&](int a, int b, double ratio) {
    const double now = HertzForce(model, a, b);
    const double most = std::pow(2.0, 1.5) * now;
    const double force = std::max(0.0, now - (ratio - 1) * (most - now));
    EXPECT_NEAR(pairs.block.normal_force[Lane(a, b)], force, 1e-9 * now) << a << b;
  };
  expect(kSteel, kGrains, 1);
  expect(kSteel, kRubber, 1.2);
  expect(kRubber, kSteel, 1.2);
  expect(kGrains, kGrains, 50);
}

TEST(PairEffects, RollingFrictionWithTheFloorIsThatOfThePair) {
  // A grain that rolls down an incline of another material does so with 5/7 g (sin a - eta cos a),
  // since the floor's moment eta N r takes eta g cos a from its 7/5 m v'.
  const double g = 9.81;
  const double alpha = 0.25;
  const auto acceleration = [&](double pair) {
    Model model =
        Three({"rolling_resistance"}, {{"rolling_resistance.stiffness_ratio", 1},
                                       {"rolling_resistance.friction", 10},
                                       {"grains-steel.rolling_resistance.friction", pair}});
    model.parameters["young_modulus"] = 1e9;
    model.parameters["steel.young_modulus"] = 3e9;
    return test::AccelerationDownASlope(model, "steel", alpha);
  };
  const double free = 5.0 / 7.0 * g * std::sin(alpha);
  EXPECT_NEAR(acceleration(0), free, 3e-3 * free);
  const double braked = 5.0 / 7.0 * g * (std::sin(alpha) - 0.1 * std::cos(alpha));
  EXPECT_NEAR(acceleration(0.1), braked, 1e-2 * braked);
  EXPECT_NEAR(acceleration(0.5), 0, 1e-2) << "the floor holds it";
}

TEST(PairEffects, MistakesAreSaid) {
  Model model = Three({"rolling_resistance"}, {{"rolling_resistance.stiffness_ratio", 1},
                                               {"rolling_resistance.friction", 0.1}});
  EXPECT_THAT(MaterialProblems(model), IsEmpty());
  EXPECT_NE(FindParameter(model, "rubber-steel.rolling_resistance.friction"), nullptr);
  EXPECT_EQ(FindParameter(model, "rubber-steel.viscous_damping.ratio"), nullptr)
      << "the effect is not in the model";
  EXPECT_EQ(FindParameter(model, "rubber-rubber.friction_coefficient"), nullptr)
      << "is rubber.friction_coefficient";
  EXPECT_THAT(MaterialParameters(model),
              Contains(std::string("rubber-rubber.rolling_resistance.friction")));
  model.parameters["rubber-rubber.rolling_resistance.stiffness"] = 1;
  model.parameters["rubber-rubber.rolling_resistance.stiffness_ratio"] = 1;
  EXPECT_THAT(MaterialProblems(model), Contains(HasSubstr("are alternatives")));
  model.parameters.erase("rubber-rubber.rolling_resistance.stiffness");
  model.parameters["grains-steel.rolling_resistance.stiffness"] = 1;
  EXPECT_THAT(MaterialProblems(model), IsEmpty());
  model.parameters["steel-grains.rolling_resistance.stiffness_ratio"] = 1;
  EXPECT_THAT(MaterialProblems(model), Contains(HasSubstr("are alternatives")))
      << "whatever the order";
  model.parameters.erase("steel-grains.rolling_resistance.stiffness_ratio");
  model.parameters["steel-rubber.rolling_resistance.friction"] = 0.1;
  model.parameters["rubber-steel.rolling_resistance.friction"] = 0.1;
  EXPECT_THAT(MaterialProblems(model), Contains(HasSubstr("are the same; give one of them")));
}

}  // namespace
}  // namespace calib::dem
