#include "dem/particles/loose_fill.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "dem/elementary/functions.h"
#include "dem/particles/random_numbers.h"

namespace calib::dem {
namespace {

/// Layers of a lattice without a height [-]. Chosen: a bound for loops, never reached.
constexpr int kMostLayers = 1'000'000;
/// Throws of a grain until a region that may grow does [-]. Chosen.
constexpr int kThrows = 200;
/// Throws of a grain until a region counts as full [-]. Chosen.
constexpr int kMostThrows = 20'000;
/// Pitch of the lattice in largest diameters [-], displacement of a grain in largest radii, either
/// way
/// [-]. Chosen together: two neighbours 2.16 radii apart, each displaced by up to 0.03 along each
/// axis, never touch.
constexpr double kPitch = 1.08;
constexpr double kJitter = 0.03;

void Shuffle(std::vector<double>& radii, std::uint64_t seed) {
  for (std::size_t k = radii.size(); k > 1; --k) {
    const double u = Uniform(seed, kOrderDraw, static_cast<int>(k), 0)[0];
    std::swap(radii[k - 1], radii[static_cast<std::size_t>(u * static_cast<double>(k))]);
  }
}

/// Spheres by the cells of a grid that is as deep as it has to be.
class Lookup {
 public:
  Lookup(const FillRegion& region, double largest)
      : region_(region),
        nx_(Count(region.width, largest)),
        ny_(Count(region.depth, largest)),
        size_{region.width / nx_, region.depth > 0 ? region.depth / ny_ : 2 * largest,
              2 * largest} {}

  /// Whether a sphere touches none of those that are there.
  [[nodiscard]] bool Free(const Sphere& sphere) const {
    const auto at = CellOf(sphere);
    for (int k = std::max(0, at[2] - 1); k <= at[2] + 1; ++k) {
      for (int j = at[1] - 1; j <= at[1] + 1; ++j) {
        for (int i = std::max(0, at[0] - 1); i <= std::min(nx_ - 1, at[0] + 1); ++i) {
          for (const Sphere& other : Cell(i, j, k)) {
            if (Touches(sphere, other)) {
              return false;
            }
          }
        }
      }
    }
    return true;
  }

  void Add(const Sphere& sphere) {
    const auto at = CellOf(sphere);
    const std::size_t index = Index(at[0], Around(at[1]), at[2]);
    if (cells_.size() <= index) {
      cells_.resize(index + 1);
    }
    cells_[index].push_back(sphere);
  }

 private:
  static int Count(double length, double largest) {
    return std::max(1, static_cast<int>(length / (2 * largest)));
  }
  [[nodiscard]] int Around(int j) const { return ((j % ny_) + ny_) % ny_; }
  [[nodiscard]] std::size_t Index(int i, int j, int k) const {
    const auto layer = static_cast<std::size_t>(k) * static_cast<std::size_t>(ny_);
    return (layer + static_cast<std::size_t>(j)) * static_cast<std::size_t>(nx_) +
           static_cast<std::size_t>(i);
  }
  [[nodiscard]] std::array<int, 3> CellOf(const Sphere& s) const {
    const auto cell = [](double x, double size) { return static_cast<int>(std::floor(x / size)); };
    return {std::clamp(cell(s.centre[0] - region_.low.x, size_[0]), 0, nx_ - 1),
            cell(s.centre[1] - region_.low.y, size_[1]),
            std::max(0, cell(s.centre[2] - region_.low.z, size_[2]))};
  }
  [[nodiscard]] const std::vector<Sphere>& Cell(int i, int j, int k) const {
    static const std::vector<Sphere> kNone;
    const bool beyond = !region_.repeats && (j < 0 || j >= ny_);
    const std::size_t index = Index(i, Around(j), k);
    return beyond || index >= cells_.size() ? kNone : cells_[index];
  }
  [[nodiscard]] bool Touches(const Sphere& a, const Sphere& b) const {
    double dy = a.centre[1] - b.centre[1];
    if (region_.repeats) {
      dy -= std::round(dy / region_.depth) * region_.depth;
    }
    return Hypotenuse(a.centre[0] - b.centre[0], dy, a.centre[2] - b.centre[2]) <
           a.radius + b.radius;
  }

  const FillRegion& region_;
  int nx_, ny_;
  std::array<double, 3> size_;
  std::vector<std::vector<Sphere>> cells_;
};

/// Whether a region of that height holds the whole sphere.
bool Holds(const FillRegion& region, double height, const Sphere& s) {
  const double up = s.centre[2] - region.low.z;
  const double back = s.centre[1] - region.low.y;
  return up >= s.radius && up + s.radius <= height &&
         (region.repeats || !(region.depth > 0) ||
          (back >= s.radius && back + s.radius <= region.depth)) &&
         region.holds({s.centre[0], s.centre[1], s.centre[2]}, s.radius);
}

}  // namespace

Packing RandomFill(std::vector<double> radii, const ClumpTemplate& shape, const FillRegion& region,
                   std::uint64_t seed) {
  Packing packing;
  Shuffle(radii, seed);
  const double largest = *std::max_element(radii.begin(), radii.end());
  const double length = 2 * ReachOf(shape) * largest;
  double thickest = 0;
  for (const Sphere& member : shape.spheres) {
    thickest = std::max(thickest, member.radius);
  }
  Lookup placed(region, largest * thickest);
  double height = region.height > 0 ? region.height : 2 * length;
  for (int grain = 0; grain < static_cast<int>(radii.size()); ++grain) {
    const double radius = radii[static_cast<std::size_t>(grain)];
    std::vector<Sphere> members;
    for (int draw = 0; members.empty(); ++draw) {
      if (draw == kMostThrows) {
        return packing;
      }
      if (!(region.height > 0) && draw % kThrows == kThrows - 1) {
        height += length;
      }
      const auto u = Uniform(seed, kFillDraw, grain, draw);
      const Rotation rotation = region.depth > 0 ? DrawRotation(seed, grain, draw)
                                                 : DrawRotationInPlane(seed, grain, draw);
      for (const Sphere& member : shape.spheres) {
        members.push_back(
            Placed(member, rotation, radius,
                   {region.low.x + u[0] * region.width, region.low.y + u[1] * region.depth,
                    region.low.z + u[2] * height}));
        if (!Holds(region, height, members.back()) || !placed.Free(members.back())) {
          members.clear();
          break;
        }
      }
    }
    for (const Sphere& member : members) {
      placed.Add(member);
      packing.x.push_back(member.centre[0]);
      packing.y.push_back(member.centre[1]);
      packing.z.push_back(member.centre[2]);
      packing.radius.push_back(member.radius);
      packing.clump.push_back(grain);
    }
  }
  return packing;
}

Packing LooseFill(std::vector<double> radii, const FillRegion& region, std::uint64_t seed) {
  Packing packing;
  const double largest = *std::max_element(radii.begin(), radii.end());
  Shuffle(radii, seed);
  const double pitch = kPitch * 2 * largest;
  const int nx = std::max(1, static_cast<int>(region.width / pitch));
  const int ny = region.depth > 0 ? std::max(1, static_cast<int>(region.depth / pitch)) : 1;
  const double x0 = region.low.x + 0.5 * (region.width - (nx - 1) * pitch);
  const double y0 = region.low.y + 0.5 * (region.depth - (ny - 1) * pitch);
  std::size_t placed = 0;
  for (int layer = 0; placed < radii.size(); ++layer) {
    const double highest = (layer + 1) * pitch;
    if (region.height > 0 ? highest > region.height : layer > kMostLayers) {
      break;
    }
    for (int j = 0; j < ny; ++j) {
      for (int i = 0; i < nx && placed < radii.size(); ++i) {
        const auto u = Uniform(seed, kFillDraw, static_cast<int>(placed), layer);
        const auto shift = [&](std::size_t a) { return kJitter * largest * (2 * u[a] - 1); };
        const Vec3 centre{x0 + i * pitch + shift(0),
                          region.depth > 0 ? y0 + j * pitch + shift(1) : region.low.y,
                          region.low.z + (layer + 0.5) * pitch + shift(2)};
        if (!region.holds(centre, radii[placed])) {
          continue;
        }
        packing.x.push_back(centre.x);
        packing.y.push_back(centre.y);
        packing.z.push_back(centre.z);
        packing.radius.push_back(radii[placed]);
        packing.clump.push_back(-1);
        ++placed;
      }
    }
  }
  return packing;
}

double TopOf(const Packing& packing) {
  double top = packing.z.front();
  for (std::size_t k = 0; k < packing.z.size(); ++k) {
    top = std::max(top, packing.z[k] + packing.radius[k]);
  }
  return top;
}

}  // namespace calib::dem
