#include "dem/geometry/vessel_gap.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "dem/elementary/functions.h"

namespace calib::dem {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;  ///< a whole turn [rad]
/// Height above the lowest point, over the vessel's height, at which the wall has begun [-].
/// Chosen: rounded and slanting feet end below it.
constexpr double kFoot = 1e-2;
/// Widest gap that counts as closed [rad]. Chosen: seams of files in single precision are not quite
/// closed.
constexpr double kSmall = 1e-4;
/// Distance from the vertical through the origin, over the vessel's height, within which a mesh
/// closes it [-], and height within which a rim is level. Chosen: as nearly as meshes are drawn.
constexpr double kOver = 1e-3;
/// Difference of heights, over the vessel's height, within which two are one [-]. Chosen: single
/// precision.
constexpr double kLevel = 1e-6;
/// Heights that are looked at [-]. Chosen: a bound for the time that fine meshes take.
constexpr std::size_t kMostLevels = 500;

struct Place {
  double x, y;
};

/// What a horizontal cut shows in a range of directions from the axis: nothing.
struct Gap {
  double from = 0, width = 0;  ///< directions [rad]
  Place left{}, right{};       ///< where the wall ends

  [[nodiscard]] double middle() const { return from + 0.5 * width; }
};

/// A piece of wall in a cut, from one direction anticlockwise to the other.
struct Piece {
  double from = 0, width = 0;
  Place first{}, last{};
};

void Join(const Vec3& a, const Vec3& b, double z, std::vector<Place>& cut) {
  if ((a.z < z) != (b.z < z)) {
    const double share = (z - a.z) / (b.z - a.z);
    cut.push_back({a.x + share * (b.x - a.x), a.y + share * (b.y - a.y)});
  }
}

/// The directions without wall, as seen from (0, 0, z).
std::vector<Gap> GapsAt(const TriangleMesh& mesh, double z) {
  std::vector<Piece> pieces;
  for (const auto& corner : mesh.triangle) {
    std::vector<Place> cut;
    for (std::size_t k = 0; k < 3; ++k) {
      Join(mesh.vertex[static_cast<std::size_t>(corner[k])],
           mesh.vertex[static_cast<std::size_t>(corner[(k + 1) % 3])], z, cut);
    }
    if (cut.size() != 2) {
      continue;
    }
    double width =
        std::remainder(Direction(cut[1].y, cut[1].x) - Direction(cut[0].y, cut[0].x), kTurn);
    if (width < 0) {
      std::swap(cut[0], cut[1]);
      width = -width;
    }
    double from = Direction(cut[0].y, cut[0].x);
    from += from < 0 ? kTurn : 0;
    pieces.push_back({.from = from, .width = width, .first = cut[0], .last = cut[1]});
  }
  if (pieces.empty()) {
    return {{.from = 0, .width = kTurn}};
  }
  std::sort(pieces.begin(), pieces.end(),
            [](const Piece& a, const Piece& b) { return a.from < b.from; });
  // The wall seen so far ends at `end`; it begins with what the first turn leaves over.
  double end = -kTurn;
  Place last{};
  for (const Piece& piece : pieces) {
    if (piece.from + piece.width - kTurn > end) {
      end = piece.from + piece.width - kTurn;
      last = piece.last;
    }
  }
  std::vector<Gap> gaps;
  for (const Piece& piece : pieces) {
    if (piece.from - end > kSmall) {
      gaps.push_back({.from = end, .width = piece.from - end, .left = last, .right = piece.first});
    }
    if (piece.from + piece.width > end) {
      end = piece.from + piece.width;
      last = piece.last;
    }
  }
  return gaps;
}

bool Sees(const std::vector<Gap>& gaps, double direction) {
  return std::none_of(gaps.begin(), gaps.end(), [direction](const Gap& gap) {
    return std::abs(std::remainder(direction - gap.middle(), kTurn)) < 0.5 * gap.width;
  });
}

bool Surrounded(const std::vector<Gap>& gaps) {
  return std::none_of(gaps.begin(), gaps.end(),
                      [](const Gap& gap) { return gap.width >= std::numbers::pi; });
}

/// Middle heights of the edges of one triangle only that are not level, ascending.
std::vector<double> LooseHeights(const TriangleMesh& mesh, double height) {
  using Corner = std::array<std::int64_t, 3>;
  const auto place = [&](int vertex) {
    const Vec3& v = mesh.vertex[static_cast<std::size_t>(vertex)];
    const auto on_grid = [&](double s) {
      return static_cast<std::int64_t>(std::llround(s / (kLevel * height)));
    };
    return Corner{on_grid(v.x), on_grid(v.y), on_grid(v.z)};
  };
  std::map<std::pair<Corner, Corner>, int> edges;
  for (const auto& corner : mesh.triangle) {
    for (std::size_t k = 0; k < 3; ++k) {
      ++edges[std::minmax(place(corner[k]), place(corner[(k + 1) % 3]))];
    }
  }
  std::vector<std::int64_t> doubled;
  for (const auto& [ends, triangles] : edges) {
    if (triangles == 1 && std::abs(ends.first[2] - ends.second[2]) > 1) {
      doubled.push_back(ends.first[2] + ends.second[2]);
    }
  }
  std::sort(doubled.begin(), doubled.end());
  doubled.erase(std::unique(doubled.begin(), doubled.end()), doubled.end());
  const std::size_t stride = doubled.size() / kMostLevels + 1;
  std::vector<double> heights;
  for (std::size_t k = 0; k < doubled.size(); k += stride) {
    heights.push_back(0.5 * kLevel * height * static_cast<double>(doubled[k]));
  }
  return heights;
}

bool LiesOverOrigin(const TriangleMesh& mesh, double within) {
  return std::any_of(mesh.triangle.begin(), mesh.triangle.end(), [&](const auto& corner) {
    const auto at = [&](std::size_t k) -> const Vec3& {
      return mesh.vertex[static_cast<std::size_t>(corner[k])];
    };
    return Length(NearestPoint({}, at(0), at(1), at(2))) < within;
  });
}

std::string HoleAt(const Gap& gap, double z) {
  return absl::StrCat("has a hole near (", 0.5 * (gap.left.x + gap.right.x), ", ",
                      0.5 * (gap.left.y + gap.right.y), ", ", z,
                      ") m: from the middle of the vessel no wall is seen there");
}

}  // namespace

std::string VesselProblem(const TriangleMesh& mesh) {
  const Bounds bounds = BoundsOf(mesh);
  const double height = bounds.high.z - bounds.low.z;
  if (!(height > 0)) {
    return "is level: a vessel has walls that rise";
  }
  const double foot = bounds.low.z + kFoot * height;
  const std::vector<Gap> at_foot = GapsAt(mesh, foot);
  if (!Surrounded(at_foot)) {
    return absl::StrCat("does not stand around its origin, where the outlet is: it reaches from (",
                        bounds.low.x, ", ", bounds.low.y, ") to (", bounds.high.x, ", ",
                        bounds.high.y, ") m, move it so that the outlet's middle is at (0, 0)");
  }
  if (LiesOverOrigin(mesh, kOver * height)) {
    return "is closed at its origin, where the outlet is: move it, or leave its floor away";
  }
  if (!at_foot.empty()) {
    return HoleAt(at_foot.front(), foot);
  }
  std::vector<double> levels = LooseHeights(mesh, height);
  if (levels.empty()) {
    return "";
  }
  const double top = bounds.high.z - kOver * height;  // rims are level as nearly as that
  std::erase_if(levels, [&](double z) { return z < foot || z > top; });
  levels.push_back(top);
  std::vector<std::vector<Gap>> seen;
  seen.reserve(levels.size());
  for (const double z : levels) {
    seen.push_back(GapsAt(mesh, z));
  }
  for (std::size_t k = 0; k < levels.size(); ++k) {
    if (!Surrounded(seen[k])) {
      continue;
    }
    for (const Gap& gap : seen[k]) {
      const bool rim = std::none_of(seen.begin() + static_cast<std::ptrdiff_t>(k), seen.end(),
                                    [&](const auto& above) { return Sees(above, gap.middle()); });
      if (!rim) {
        return HoleAt(gap, levels[k]);
      }
    }
  }
  return "";
}

}  // namespace calib::dem
