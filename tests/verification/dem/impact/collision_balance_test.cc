// The energy of `collision`: what the shear law gives where its stiffness falls under a force that
// stays is no fault of the steps.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <string>
#include <utility>

#include "dem/registry/catalog.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

constexpr double kRadius = 0.005;  // [m]
constexpr double kDensity = 2650;  // [kg/m^3]
constexpr double kModulus = 1e8;   // [Pa]
constexpr double kSpeed = 1;       // [m/s]
constexpr double kDegree = std::numbers::pi / 180;

double Restitution(const State& state) {
  const auto& names = FindTest("collision")->observables;
  return state.values[static_cast<std::size_t>(
      std::find(names.begin(), names.end(), "energy_restitution") - names.begin())];
}

Scenario OnAWall(const std::string& contact, std::map<std::string, double> parameters,
                 double degrees) {
  Scenario s;
  s.model.contact = contact;
  s.model.density = kDensity;
  s.model.parameters = std::move(parameters);
  s.model.parameters["young_modulus"] = kModulus;
  s.test = "collision";
  s.settings = {{"radius", kRadius}, {"impact_speed", kSpeed}};
  s.path = {{.target = degrees * kDegree, .load_step = 0}};
  return s;
}

/// Normal force [N] and shear stiffness [N/m] at an overlap [m].
struct Law {
  std::function<double(double)> force, shear;
  double friction = 0;
  bool rescaled = false;  ///< the shear force falls with its stiffness
};

/// Energy restitution of a sphere on a wall by midpoint steps of the equations of motion.
double Integrated(const Law& law, double degrees) {
  const double mass = 4.0 / 3.0 * std::numbers::pi * std::pow(kRadius, 3) * kDensity;
  const double inertia = 0.4 * mass * kRadius * kRadius;
  const double dt = 2e-9;  // [s], the impacts last some 1e-4 s
  double u = 0;
  double vn = kSpeed * std::cos(degrees * kDegree);
  double vt = kSpeed * std::sin(degrees * kDegree);
  double w = 0;
  double shear = 0;
  double stiffness = 0;
  do {
    u += 0.5 * dt * vn;
    const double before = std::exchange(stiffness, law.shear(std::max(u, 0.0)));
    if (law.rescaled && stiffness < before) shear *= stiffness / before;
    const double limit = law.friction * law.force(std::max(u, 0.0));
    shear = std::clamp(shear + stiffness * (vt + kRadius * w) * dt, -limit, limit);
    vn -= dt * law.force(std::max(u, 0.0)) / mass;
    vt -= dt * shear / mass;
    w -= dt * kRadius * shear / inertia;
    u += 0.5 * dt * vn;
  } while (u > 0);
  return (mass * (vn * vn + vt * vt) + inertia * w * w) / (mass * kSpeed * kSpeed);
}

Law Hertz(double friction) {  // nu = 0
  const double root = std::sqrt(kRadius);
  return {.force = [=](double u) { return 2.0 / 3.0 * kModulus * root * u * std::sqrt(u); },
          .shear = [=](double u) { return kModulus * root * std::sqrt(u); },
          .friction = friction};
}

constexpr double kOnceRefused = 1.001;  // of the energy before; more was taken for wrong steps

TEST(CollisionBalance, EnergyThatTheShearLawGivesIsNoFault) {
  double most = 0;
  for (const double degrees : {20, 24, 28}) {
    const test::Run run = test::RunAll(
        OnAWall("hertz_mindlin", {{"poisson_ratio", 0}, {"friction_coefficient", 1}}, degrees));
    ASSERT_EQ(run.states.size(), 1U) << degrees << ": " << run.summary.reason;
    const double expected = Integrated(Hertz(1), degrees);
    EXPECT_NEAR(Restitution(run.states[0]), expected, 1e-4) << degrees;
    most = std::max(most, expected);
  }
  EXPECT_GT(most, kOnceRefused);
}

TEST(CollisionBalance, EnergyThatABentLinearLawGivesIsNoFault) {
  Scenario s = OnAWall("linear", {{"poisson_ratio", 0.25}, {"friction_coefficient", 0.3}}, 32);
  s = test::With(s, "hertz_nonlinearity", {{"exponent", 2}, {"reference_pressure", 1e5}});
  double most = 0;
  for (const double ratio : {0.25, 0.5, 1.0}) {
    s.model.parameters["poisson_ratio"] = ratio;
    // F = F_b^2/(p (4 r*)^2), F_b = 2 E r* u
    const double kn = 2 * kModulus * kRadius;
    const double reference = 1e5 * 16 * kRadius * kRadius;
    const Law law{.force = [=](double u) { return kn * u * kn * u / reference; },
                  .shear = [=](double u) { return ratio * kn * 2 * kn * u / reference; },
                  .friction = 0.3};
    const test::Run run = test::RunAll(s);
    ASSERT_EQ(run.states.size(), 1U) << ratio << ": " << run.summary.reason;
    const double expected = Integrated(law, 32);
    EXPECT_NEAR(Restitution(run.states[0]), expected, 1e-4) << ratio;
    most = std::max(most, expected);
  }
  EXPECT_GT(most, kOnceRefused);
}

TEST(CollisionBalance, RescaledShearGivesNoEnergy) {
  for (const double degrees : {20, 24, 28}) {
    Scenario s =
        OnAWall("hertz_mindlin", {{"poisson_ratio", 0}, {"friction_coefficient", 1}}, degrees);
    s.model.shear_unloading = ShearUnloading::kRescaled;
    const test::Run run = test::RunAll(s);
    ASSERT_EQ(run.states.size(), 1U) << degrees << ": " << run.summary.reason;
    Law law = Hertz(1);
    law.rescaled = true;
    const double expected = Integrated(law, degrees);
    EXPECT_NEAR(Restitution(run.states[0]), expected, 1e-4) << degrees;
    EXPECT_LE(expected, 1) << degrees;
  }
}

// Whatever a model has that stores energy, on walls, equal and smaller partners.
TEST(CollisionBalance, NoModelOfTheCatalogueIsRefusedForItsEnergy) {
  const auto variants = [](const Scenario& s) {
    const std::map<std::string, double> roll = {{"stiffness_ratio", 0.5}, {"friction", 0.5}};
    std::vector<Scenario> all = {
        s,
        test::With(s, "rolling_resistance", roll),
        test::With(s, "contact_plasticity", {{"stiffness_ratio", 1.3}}),
        test::With(s, "viscous_damping", {{"ratio", 0.02}}),
        test::With(s, "adhesion_dmt", {{"work_of_adhesion", 1}}),
        test::With(s, "hertz_nonlinearity", {{"exponent", 2.5}, {"reference_pressure", 1e5}})};
    if (s.model.contact == "hertz_mindlin") {
      all.push_back(test::With(s, "adhesion_jkr", {{"work_of_adhesion", 1}}));
    }
    return all;
  };
  for (const char* contact : {"hertz_mindlin", "linear"}) {
    for (const auto& [friction, unloading] :
         {std::pair(0.3, ShearUnloading::kAsPublished), std::pair(1.0, ShearUnloading::kRescaled),
          std::pair(1.0, ShearUnloading::kAsPublished),
          std::pair(10.0, ShearUnloading::kAsPublished)}) {
      for (const double partner :
           {std::numeric_limits<double>::infinity(), kRadius, 0.3 * kRadius}) {
        Scenario s =
            OnAWall(contact, {{"poisson_ratio", 0}, {"friction_coefficient", friction}}, 0);
        if (std::string(contact) == "linear") {
          s.model.parameters["poisson_ratio"] = 0.7;
        }
        s.model.shear_unloading = unloading;
        s.settings["partner_radius"] = partner;
        s.path.clear();
        for (int k = 0; k < 16; ++k) {
          s.path.push_back({.target = (1 + 5 * k) * kDegree, .load_step = k});
        }
        for (const double spin : {-200.0, 0.0, 200.0}) {
          s.settings["impact_spin"] = spin;
          for (const Scenario& one : variants(s)) {
            const test::Run run = test::RunAll(one);
            EXPECT_THAT(run.summary.reason, testing::Not(testing::HasSubstr("energy")))
                << contact << " " << friction << " " << partner << " " << spin << " "
                << (one.model.effects.empty() ? "" : one.model.effects.back());
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace calib::dem
