#include "server/campaign/file/read_recipe.h"

#include <cmath>
#include <cstddef>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "server/campaign/keys/bounds.h"

namespace calib::campaign {
namespace {

/// A sample of a curve is off it by the mass of its largest grain at most.
constexpr double kLargestShare = 0.05;

// --- sizes ---------------------------------------------------------------------------------------

std::optional<dem::Grading> ReadCurve(MapReader& sizes) {
  const YamlNode* node = sizes.Find("cumulative");
  const auto refuse = [&sizes](const std::string& message) {
    sizes.Problem("cumulative", message);
    return std::nullopt;
  };
  bool formed = node->kind == YamlNode::Kind::kSequence && node->items.size() >= 2;
  for (std::size_t k = 0; formed && k < node->items.size(); ++k) {
    formed = node->items[k].kind == YamlNode::Kind::kSequence && node->items[k].items.size() == 2;
  }
  if (!formed) {
    return refuse(
        "is no list of two or more points [size, share of the mass that is finer], e.g. "
        "[[0.5 mm, 0], [1 mm, 0.4], [2 mm, 1]]");
  }
  const std::size_t before = sizes.problems().size();
  dem::Grading curve;
  for (std::size_t k = 0; k < node->items.size(); ++k) {
    const std::string path = absl::StrCat(sizes.PathOf("cumulative"), "[", k + 1, "]");
    const std::vector<YamlNode>& pair = node->items[k].items;
    const auto size = ReadQuantity(pair[0], path, "m", kGrainSize, sizes.problems());
    const auto finer = ReadQuantity(pair[1], path, "1", {.min = 0, .max = 1}, sizes.problems());
    if (size && finer) curve.push_back({.radius = *size, .finer = *finer});
  }
  if (sizes.problems().size() > before) return std::nullopt;
  for (std::size_t k = 1; k < curve.size(); ++k) {
    if (!(curve[k].radius > curve[k - 1].radius)) {
      return refuse(absl::StrCat("point ", k + 1, " is no larger than point ", k,
                                 "; sizes have to increase"));
    }
    if (curve[k].finer < curve[k - 1].finer) {
      return refuse(absl::StrCat("less is finer than point ", k + 1, " than is finer than point ",
                                 k, "; shares of the mass that is finer cannot fall"));
    }
  }
  if (curve.front().finer != 0 || curve.back().finer != 1) {
    return refuse(
        "has to begin at a size that nothing is finer than (0) and to end at one that all is finer "
        "than (1)");
  }
  return curve;
}

std::optional<dem::Grading> ReadLogNormal(MapReader& sizes) {
  const auto median = sizes.Quantity("median");
  sizes.Require("log_sd", "the standard deviation of the logarithm of the size, e.g. 0.3");
  const auto log_sd = sizes.Quantity("log_sd");
  if (!median || !log_sd) return std::nullopt;
  return dem::LogNormalGrading(*median, *log_sd);
}

// Grains that are enough for none to have more than its share of the mass; most: none are.
int EnoughFor(const dem::Grading& curve, int particles) {
  while (particles < kMostGrains &&
         dem::LargestShare(dem::GradedRadii(curve, particles)) > kLargestShare) {
    particles += particles / 20 + 1;
  }
  return particles;
}

void CheckGrains(const MapReader& map, const std::string& key, const std::vector<double>& radii,
                 const dem::PackingRecipe& recipe) {
  const double share = dem::LargestShare(radii);
  if (share <= kLargestShare) return;
  const int enough = EnoughFor(recipe.grading, recipe.particles);
  map.Problem(
      key, absl::StrCat(recipe.particles,
                        " grains cannot follow the curve: the largest alone would hold ",
                        absl::StrFormat("%.0f", 100 * share), " % of the mass, allowed is ",
                        100 * kLargestShare, " %; ",
                        enough < kMostGrains
                            ? absl::StrCat("take ", enough, " grains or more, or cut the curve off")
                            : "cut the curve off"));
}

void ReadSizes(MapReader& map, dem::PackingRecipe& recipe) {
  map.Ignore({"radii", "diameters"});
  if (map.Has("radii") && map.Has("diameters")) {
    map.Problem("diameters", "and radii say the same thing; give one of them");
    return;
  }
  const std::string key = map.Has("diameters") ? "diameters" : "radii";
  if (map.Require(key, "e.g. {mean: 1 mm, spread: 0.3}") == nullptr) return;
  const double to_radius = key == "diameters" ? 0.5 : 1;
  auto sizes = map.Map(key);
  if (!sizes) return;
  const int forms = static_cast<int>(sizes->Has("mean")) +
                    static_cast<int>(sizes->Has("cumulative")) +
                    static_cast<int>(sizes->Has("median"));
  if (forms != 1) {
    map.Problem(key, "needs exactly one of mean (and spread), cumulative, and median (and log_sd)");
    return;
  }
  if (sizes->Has("mean")) {
    recipe.mean_radius = to_radius * sizes->Quantity("mean").value_or(1);
    recipe.radius_spread = sizes->Quantity("spread").value_or(recipe.radius_spread);
  } else {
    auto curve = sizes->Has("cumulative") ? ReadCurve(*sizes) : ReadLogNormal(*sizes);
    if (curve) {
      for (dem::GradingPoint& point : *curve) point.radius *= to_radius;
      recipe.grading = *std::move(curve);
      const std::vector<double> radii = dem::GradedRadii(recipe.grading, recipe.particles);
      recipe.mean_radius =
          std::accumulate(radii.begin(), radii.end(), 0.0) / static_cast<double>(radii.size());
      recipe.radius_spread = 0;
      CheckGrains(map, key, radii, recipe);
    }
  }
  sizes->Finish();
}

}  // namespace

std::optional<dem::PackingRecipe> ReadRecipe(MapReader& map, bool poured) {
  const std::size_t before = map.problems().size();
  dem::PackingRecipe recipe;
  recipe.particles = static_cast<int>(map.Integer("particles").value_or(recipe.particles));
  const auto porosity = map.Quantity("porosity");
  const auto void_ratio = map.Quantity("void_ratio");
  if (poured) {
    for (const char* key : {"porosity", "void_ratio", "aspect", "pressure"}) {
      if (map.Has(key)) map.Problem(key, "has no meaning here: the test pours the grains itself");
    }
  } else if (map.Has("porosity") == map.Has("void_ratio")) {
    map.Problem("porosity", map.Has("porosity")
                                ? "and void_ratio say the same thing; give one of them"
                                : "is missing; give porosity or void_ratio");
  }
  if (porosity) recipe.porosity = *porosity;
  if (void_ratio) recipe.porosity = *void_ratio / (1 + *void_ratio);
  ReadSizes(map, recipe);
  recipe.aspect = map.Quantity("aspect").value_or(recipe.aspect);
  recipe.pressure = map.Quantity("pressure").value_or(recipe.pressure);
  recipe.seed = map.Seed("seed").value_or(recipe.seed);
  map.Finish();
  if (map.problems().size() > before) return std::nullopt;
  return recipe;
}

}  // namespace calib::campaign
