#include "dem/measure/free_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "dem/elementary/functions.h"

namespace calib::dem {
namespace {

struct Point {
  double s = 0;  ///< along the surface
  double h = 0;  ///< its height
};

double SlopeOf(const std::vector<Point>& points) {
  double s = 0;
  double h = 0;
  for (const Point& p : points) {
    s += p.s;
    h += p.h;
  }
  const auto n = static_cast<double>(points.size());
  double ss = 0;
  double sh = 0;
  for (const Point& p : points) {
    ss += (p.s - s / n) * (p.s - s / n);
    sh += (p.s - s / n) * (p.h - h / n);
  }
  return sh / ss;
}

/// Height of a column without grains [m].
constexpr double kEmpty = -std::numeric_limits<double>::infinity();

/// Highest points in columns of x from `from` on.
std::vector<double> Columns(const ParticleArrays& p, double from, double width, double highest) {
  std::vector<double> top;
  for (std::size_t g = 0; g < p.x.size(); ++g) {
    if (p.z[g] > highest || p.x[g] < from) {
      continue;
    }
    const auto c = static_cast<std::size_t>((p.x[g] - from) / width);
    if (c >= top.size()) {
      top.resize(c + 1, kEmpty);
    }
    top[c] = std::max(top[c], p.z[g] + p.radius[g]);
  }
  return top;
}

}  // namespace

Heap ConicalHeap(const ParticleArrays& p, const Vec3& axis, double diameter) {
  constexpr int kSectors = 8;  // [-], chosen: a ring of a small heap has a grain in most of them
  std::vector<double> top;     // [ring * kSectors + sector]
  for (std::size_t g = 0; g < p.x.size(); ++g) {
    const double x = p.x[g] - axis.x;
    const double y = p.y[g] - axis.y;
    const auto ring = static_cast<std::size_t>(Hypotenuse(x, y) / diameter);
    const double turn = Direction(y, x) / (2 * std::numbers::pi) + 0.5;
    const auto sector =
        std::min(static_cast<std::size_t>(turn * kSectors), std::size_t{kSectors} - 1);
    const std::size_t cell = ring * kSectors + sector;
    if (cell >= top.size()) {
      top.resize((ring + 1) * kSectors, kEmpty);
    }
    top[cell] = std::max(top[cell], p.z[g] + p.radius[g]);
  }
  std::vector<Point> surface;
  Heap heap;
  for (std::size_t ring = 0; ring * kSectors < top.size(); ++ring) {
    double sum = 0;
    int held = 0;
    for (std::size_t s = 0; s < kSectors; ++s) {
      const double h = top[ring * kSectors + s];
      sum += h > kEmpty ? h : 0.0;
      held += h > kEmpty ? 1 : 0;
    }
    if (held > 0) {
      // An empty sector is bare floor, except in the middle, where sectors are smaller than grains.
      const double h = sum / (ring == 0 ? held : kSectors);
      surface.push_back({.s = (static_cast<double>(ring) + 0.5) * diameter, .h = h});
      heap.height = std::max(heap.height, h);
    }
  }
  // The slope ends where a single layer begins: grains that have rolled away are no heap.
  const double low = std::max(0.15 * heap.height, diameter);
  surface.erase(std::find_if(surface.begin(), surface.end(),
                             [&](const Point& point) { return point.h < low; }),
                surface.end());
  std::erase_if(surface, [&](const Point& point) { return point.h > 0.85 * heap.height; });
  if (heap.height >= 2 * diameter && surface.size() >= 3) {
    heap.angle = std::max(0.0, Arctangent(-SlopeOf(surface)));
  }
  return heap;
}

std::optional<double> SurfaceSlope(const ParticleArrays& p, double diameter, double share) {
  if (p.x.empty()) {
    return std::nullopt;
  }
  const auto [low, high] = std::minmax_element(p.x.begin(), p.x.end());
  const double middle = 0.5 * (*low + *high);
  const double half = 0.5 * share * (*high - *low);
  const std::vector<double> top =
      Columns(p, *low, diameter, std::numeric_limits<double>::infinity());
  std::vector<Point> surface;
  for (std::size_t c = 0; c < top.size(); ++c) {
    const double x = *low + (static_cast<double>(c) + 0.5) * diameter;
    if (top[c] > kEmpty && std::abs(x - middle) <= half) {
      surface.push_back({.s = x, .h = top[c]});
    }
  }
  if (surface.size() < 3) {
    return std::nullopt;
  }
  return Arctangent(SlopeOf(surface));
}

std::optional<Heap> SigmoidPile(const ParticleArrays& p, const PileBounds& bounds,
                                double diameter) {
  std::vector<double> top = Columns(p, bounds.wall, diameter, bounds.highest);
  std::vector<Point> surface;
  const double length = bounds.end - bounds.wall;
  int held = 0;
  for (std::size_t c = 0; static_cast<double>(c) * diameter < length; ++c) {
    const bool holds = c < top.size() && top[c] > kEmpty;
    held += holds ? 1 : 0;
    surface.push_back({.s = (static_cast<double>(c) + 0.5) * diameter, .h = holds ? top[c] : 0.0});
  }
  if (held < 4) {
    return std::nullopt;
  }
  // For each place and width of the step its best height is linear; the grid is refined about the
  // best of them.
  double best = std::numeric_limits<double>::infinity();
  double best_place = 0;
  double best_width = 0;
  double best_height = 0;
  double low_place = 0;
  double high_place = length;
  double low_width = 0.3 * diameter;
  double high_width = 0.5 * length;
  constexpr int kPoints = 24;  // intervals of a grid [-], chosen: each level is 12 times as fine
  for (int level = 0; level < 6; ++level) {
    for (int i = 0; i <= kPoints; ++i) {
      for (int j = 0; j <= kPoints; ++j) {
        const double place = low_place + (high_place - low_place) * i / kPoints;
        const double width = low_width + (high_width - low_width) * j / kPoints;
        double ff = 0;
        double fh = 0;
        double hh = 0;
        for (const Point& point : surface) {
          const double f = 1.0 / (1.0 + Exp((point.s - place) / width));
          ff += f * f;
          fh += f * point.h;
          hh += point.h * point.h;
        }
        const double residual = hh - fh * fh / ff;
        if (residual < best) {
          best = residual;
          best_place = place;
          best_width = width;
          best_height = fh / ff;
        }
      }
    }
    const double half_place = (high_place - low_place) / kPoints;
    const double half_width = (high_width - low_width) / kPoints;
    low_place = std::max(0.0, best_place - half_place);
    high_place = std::min(length, best_place + half_place);
    low_width = std::max(0.3 * diameter, best_width - half_width);
    high_width = best_width + half_width;
  }
  Heap heap;
  heap.angle = Arctangent(best_height / (4 * best_width));
  heap.height = *std::max_element(top.begin(), top.end());
  return heap;
}

}  // namespace calib::dem
