// What a packing says of how another one like it is made, and what a recipe says of its grains.
#include <algorithm>
#include <numbers>
#include <numeric>

#include "dem/particles/packing.h"

namespace calib::dem {

double PorosityOf(const Packing& packing) {
  double solid = 0;
  for (const double r : packing.radius) {
    solid += 4.0 / 3.0 * std::numbers::pi * r * r * r;
  }
  return 1 - solid / (packing.length[0] * packing.length[1] * packing.length[2]);
}

double LargestRadius(const PackingRecipe& recipe) {
  if (!recipe.radii.empty()) {
    return *std::max_element(recipe.radii.begin(), recipe.radii.end());
  }
  if (!recipe.grading.empty()) {
    return GradedRadii(recipe.grading, recipe.particles).front();
  }
  return recipe.mean_radius * (1 + recipe.radius_spread);
}

PackingRecipe RecipeLike(const Packing& packing) {
  PackingRecipe recipe;
  recipe.particles = static_cast<int>(packing.radius.size());
  recipe.porosity = PorosityOf(packing);
  recipe.mean_radius = std::accumulate(packing.radius.begin(), packing.radius.end(), 0.0) /
                       static_cast<double>(packing.radius.size());
  recipe.radius_spread = 0;
  recipe.aspect = packing.length[2] / packing.length[0];
  recipe.depth_ratio = packing.length[1] / packing.length[0];
  recipe.radii = packing.radius;
  return recipe;
}

}  // namespace calib::dem
