// Collisions of a steel sphere with a wall against an independent integration of 1e5 steps each
// (reference/restitution beside the data).
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <numbers>

#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

TEST(CollisionReference, RestitutionWithinTenThousandth) {
  const char* data = std::getenv("CALIB_DATA");
  ASSERT_NE(data, nullptr);
  const auto reference = nlohmann::json::parse(
      test::ReadFile(std::string(data) + "/../reference/restitution/forward_model.json"));
  const auto& constants = reference.at("constants");
  const double radius = constants.at("R_m");
  double worst = 0;
  int checked = 0;
  for (const auto& one : reference.at("cases")) {
    Scenario s;
    s.model.contact = "extended_viscoelastic";
    s.model.density = constants.at("mass_kg").get<double>() /
                      (4.0 / 3.0 * std::numbers::pi * radius * radius * radius);
    s.model.parameters = {
        {"young_modulus", constants.at("E_Pa")}, {"poisson_ratio", constants.at("nu")},
        {"friction_coefficient", one.at("mu")},  {"tangential_stiffness", one.at("k_t")},
        {"damping", one.at("gamma_n")},          {"damping_exponent", one.at("alpha_n")}};
    s.test = "collision";
    s.settings = {{"radius", radius}, {"impact_speed", one.at("total_speed")}};
    const auto angles = one.at("impact_angle_deg").get<std::vector<double>>();
    for (std::size_t k = 0; k < angles.size(); ++k) {
      s.path.push_back(
          {.target = angles[k] * std::numbers::pi / 180, .load_step = static_cast<int>(k)});
    }
    const test::Run run = test::RunAll(s);
    ASSERT_EQ(run.states.size(), angles.size());
    for (std::size_t k = 0; k < angles.size(); ++k) {
      for (const auto& [name, at] : {std::pair("cnr", 3U), std::pair("ctr", 4U)}) {
        const double error = run.states[k].values[at] - one.at(name)[k].get<double>();
        EXPECT_NEAR(error, 0, 1e-4) << one.at("model") << " " << name << " " << angles[k];
        worst = std::max(worst, std::abs(error));
        ++checked;
      }
    }
  }
  std::printf("%d restitution coefficients, largest error %.2g\n", checked, worst);
  EXPECT_GE(checked, 48);
}

}  // namespace
}  // namespace calib::dem
