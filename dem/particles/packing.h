#pragma once
// Initial positions and sizes of the grains of one specimen in its periodic cell.

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "dem/particles/grading.h"

namespace calib::dem {

/// Grains of one specimen; arrays have one element per sphere.
struct Packing {
  double length[3] = {0, 0, 0};         ///< periodic cell [m], axial direction last (z)
  std::vector<double> x, y, z, radius;  ///< [m], size N each
  std::vector<int> clump;               ///< -1: single sphere; equal ids move as one rigid body
  std::vector<std::string> material{};  ///< of each grain, "" or `grains`: the model's own; no
                                        ///< elements: all grains are of the model's own
};

/// One thing wrong in a text file. line is 1-based; 0: the file as a whole.
struct PackingProblem {
  int line = 0;
  std::string message;
};

/// Reads `##PERIODIC:: Lx Ly Lz` followed by `x y z r clump` or `x y z r clump material` per line
/// (blank lines, # comments and a byte order mark allowed) [m]. Appends everything wrong to
/// problems (not a number, missing fields, a cell's length outside 1e-9 to 1e6 m, radius below 1e-9
/// m or too large for the cell, a grain outside the cell by more than half its length, fewer than
/// two grains); centres outside by less belong to an image; the result is meaningful only if none
/// was added.
Packing ParsePacking(const std::string& text, std::vector<PackingProblem>& problems);

/// The packing as text that ParsePacking() reads, with 17 digits: reading it gives the same bits
/// back.
std::string FormatPacking(const Packing& packing);

/// How to make a specimen: a cloud, compressed isotropically, then friction lowered step by step
/// until the target porosity holds at the pressure. [Cheng 2018, sec. 2.2]
struct PackingRecipe {
  int particles = 1000;        ///< 20 .. 1e6
  double porosity = 0.4;       ///< target, in (0.2, 0.6), or of a cloud, [0.7, 1)
  double mean_radius = 1e-3;   ///< [m] > 0
  double radius_spread = 0.3;  ///< uniform in mean*(1 -/+ spread), 0 <= spread < 1
  double aspect = 1.0;         ///< cell height / width (z / x), 0.2 .. 5
  double pressure = 1e4;       ///< [Pa] > 0 during generation
  std::uint64_t seed = 1;
  double depth_ratio = 1.0;  ///< of the cell, y / x, 0.2 .. 5
  /// Sizes by a grading curve in place of mean and spread, the same for every seed.
  Grading grading{};
  /// Radius of every grain [m], `particles` of them, in place of mean, spread and grading.
  std::vector<double> radii{};
};

/// Radius of the largest grain that the recipe can give [m].
double LargestRadius(const PackingRecipe& recipe);

/// The recipe of another packing of the grains of `packing`, which has single spheres only: its
/// radii, its porosity and the shape of its cell. Compressed by other random places, the cell ends
/// near that shape.
PackingRecipe RecipeLike(const Packing& packing);

/// Porosity of the packing [-]: 1 - volume of all spheres / volume of the cell. Overlaps count
/// twice.
double PorosityOf(const Packing& packing);

}  // namespace calib::dem
