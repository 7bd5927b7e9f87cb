#include "dem/simulate/packing_generator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "dem/dynamics/assembly.h"
#include "dem/registry/registry.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

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
  Assembly assembly(*packing, 2650, ContactModelOf(model), 1);
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

std::vector<double> Sorted(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values;
}

TEST(GeneratePacking, AnotherPackingOfTheSameGrainsIsAsDense) {
  const auto file = GeneratePacking({.particles = 300,
                                     .porosity = 0.40,
                                     .aspect = 1.5,
                                     .seed = 3,
                                     .depth_ratio = 2,
                                     .grading = {{1e-3, 0}, {1.5e-3, 0.4}, {2e-3, 1}}},
                                    1, {});
  ASSERT_TRUE(file.ok()) << file.status();
  PackingRecipe recipe = RecipeLike(*file);
  std::vector<Packing> others;
  for (const std::uint64_t seed : {11, 12, 11}) {
    recipe.seed = seed;
    const auto other = GeneratePacking(recipe, 1, {});
    ASSERT_TRUE(other.ok()) << other.status();
    EXPECT_EQ(Sorted(other->radius), Sorted(file->radius));
    EXPECT_NEAR(PorosityOf(*other), PorosityOf(*file), 1e-3);
    EXPECT_NEAR(other->length[2] / other->length[0], file->length[2] / file->length[0], 0.2);
    EXPECT_NEAR(other->length[1] / other->length[0], file->length[1] / file->length[0], 0.2);
    others.push_back(*other);
  }
  EXPECT_EQ(FormatPacking(others[2]), FormatPacking(others[0]));
  EXPECT_NE(others[1].x, others[0].x);
  EXPECT_NE(others[0].x, file->x);
}

TEST(GeneratePacking, AnotherCloudIsACloud) {
  const auto file = GenerateSizes({.particles = 200, .radius_spread = 0.4, .aspect = 2, .seed = 3});
  ASSERT_TRUE(file.ok()) << file.status();
  PackingRecipe recipe = RecipeLike(*file);
  recipe.seed = 4;
  const auto other = GeneratePacking(recipe, 1, {});
  ASSERT_TRUE(other.ok()) << other.status();
  EXPECT_EQ(other->radius, file->radius);
  EXPECT_NEAR(PorosityOf(*other), PorosityOf(*file), 1e-12);
  EXPECT_NEAR(other->length[2], file->length[2], 1e-12);
  EXPECT_NE(other->x, file->x);
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
