#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dem/dynamics/assembly.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

double PorosityOf(const Packing& p) {
  double solid = 0;
  for (const double r : p.radius) {
    solid += 4.0 / 3.0 * std::numbers::pi * r * r * r;
  }
  return 1 - solid / (p.length[0] * p.length[1] * p.length[2]);
}

TEST(GeneratePacking, HitsPorosityAndPressure) {
  const PackingRecipe recipe{.particles = 300,
                             .porosity = 0.40,
                             .radius_spread = 0.2,
                             .aspect = 1.5,
                             .pressure = 2e4,
                             .seed = 3};
  const auto packing = GeneratePacking(recipe, 1, {});
  ASSERT_TRUE(packing.ok()) << packing.status();
  EXPECT_EQ(packing->x.size(), 300U);
  EXPECT_NEAR(PorosityOf(*packing), 0.40, 2e-4);
  EXPECT_NEAR(packing->length[2] / packing->length[0], 1.5, 0.2);
  // The generator's own contacts: linear, 5000 x the pressure. Normal forces alone carry the mean
  // stress.
  Model model = test::LinearModel();
  model.parameters["young_modulus"] = 5e3 * recipe.pressure;
  Assembly assembly(*packing, 2650, ContactModel(model), 1);
  ASSERT_TRUE(assembly.EvaluateForces().ok());
  const auto& s = assembly.stress();
  EXPECT_NEAR((s[0] + s[1] + s[2]) / 3, recipe.pressure, 0.01 * recipe.pressure);
}

TEST(GeneratePacking, SameRecipeSameBitsOnAnyThreads) {
  const PackingRecipe recipe{.particles = 300, .porosity = 0.42};
  const auto one = GeneratePacking(recipe, 1, {});
  const auto two = GeneratePacking(recipe, 2, {});
  ASSERT_TRUE(one.ok() && two.ok());
  EXPECT_EQ(FormatPacking(*one), FormatPacking(*two));
  PackingRecipe other = recipe;
  other.seed = 2;
  const auto different = GeneratePacking(other, 1, {});
  ASSERT_TRUE(different.ok());
  EXPECT_NE(FormatPacking(*one), FormatPacking(*different));
}

TEST(GeneratePacking, SaysWhichPorositiesAreAttainable) {
  const auto loose = GeneratePacking({.particles = 100, .porosity = 0.55}, 1, {});
  EXPECT_EQ(loose.status().code(), absl::StatusCode::kOutOfRange);
  EXPECT_THAT(std::string(loose.status().message()), testing::HasSubstr("attainable is 0.3"));
  const auto dense = GeneratePacking({.particles = 100, .porosity = 0.25}, 1, {});
  EXPECT_EQ(dense.status().code(), absl::StatusCode::kOutOfRange);
}

}  // namespace
}  // namespace calib::dem
