#include "dem/particles/union_of_spheres.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "dem/elementary/functions.h"

namespace calib::dem {
namespace {

using Vector = std::array<double, 3>;
using Tensor = std::array<Vector, 3>;

/// Lines of the grid along each of its two axes [-]. Measured: relative error 1.4e-4
/// (UnionOfSpheres.* in tests/unit/dem).
constexpr int kLines = 160;
/// Overlap over the sum of the radii below which spheres count as apart [-]. Chosen: far above
/// rounding, without volume.
constexpr double kTouching = 1e-9;

bool AnyOverlap(const std::vector<Sphere>& spheres) {
  for (std::size_t i = 0; i < spheres.size(); ++i) {
    for (std::size_t j = i + 1; j < spheres.size(); ++j) {
      const Sphere& a = spheres[i];
      const Sphere& b = spheres[j];
      if (Hypotenuse(a.centre[0] - b.centre[0], a.centre[1] - b.centre[1],
                     a.centre[2] - b.centre[2]) < (1.0 - kTouching) * (a.radius + b.radius)) {
        return true;
      }
    }
  }
  return false;
}

/// Integrals of 1, x_a and x_a x_b over the solid, about the origin.
struct RawMoments {
  double volume = 0;
  Vector first{};
  Tensor second{};
};

RawMoments AddUp(const std::vector<Sphere>& spheres) {
  RawMoments m;
  for (const Sphere& s : spheres) {
    const double volume = 4.0 / 3.0 * std::numbers::pi * s.radius * s.radius * s.radius;
    m.volume += volume;
    for (std::size_t a = 0; a < 3; ++a) {
      m.first[a] += volume * s.centre[a];
      m.second[a][a] += 0.2 * volume * s.radius * s.radius;
      for (std::size_t b = 0; b < 3; ++b) {
        m.second[a][b] += volume * s.centre[a] * s.centre[b];
      }
    }
  }
  return m;
}

/// Adds the line through (y, z), of cross section `area`, over its intervals inside the spheres.
void AddLine(const std::vector<std::pair<double, double>>& intervals, double y, double z,
             double area, RawMoments& m) {
  for (const auto& [from, to] : intervals) {
    const double length = area * (to - from);
    const double x = area * 0.5 * (to * to - from * from);
    m.volume += length;
    m.first[0] += x;
    m.first[1] += length * y;
    m.first[2] += length * z;
    m.second[0][0] += area * (to * to * to - from * from * from) / 3.0;
    m.second[1][1] += length * y * y;
    m.second[2][2] += length * z * z;
    m.second[0][1] += x * y;
    m.second[0][2] += x * z;
    m.second[1][2] += length * y * z;
  }
}

/// Two spheres that cut each other are a body of revolution: its integrals over the axis are of
/// polynomials up to the fourth degree, which three Gauss points give exactly. Precondition: the
/// first lies at the origin.
RawMoments Revolve(const Sphere& a, const Sphere& b) {
  const double d = Hypotenuse(b.centre[0], b.centre[1], b.centre[2]);
  const Vector axis = {b.centre[0] / d, b.centre[1] / d, b.centre[2] / d};
  const double plane = (d * d + a.radius * a.radius - b.radius * b.radius) / (2.0 * d);
  const double node = std::sqrt(0.6);
  double sums[4] = {0, 0, 0, 0};  // of 1, s, s^2 and the square of one distance from the axis
  const auto add = [&](double from, double to, double centre, double radius) {
    for (const auto& [place, weight] :
         {std::pair(-node, 5.0 / 18.0), std::pair(0.0, 8.0 / 18.0), std::pair(node, 5.0 / 18.0)}) {
      const double s = 0.5 * (from + to + place * (to - from));
      const double rho2 = radius * radius - (s - centre) * (s - centre);
      const double area = weight * (to - from) * std::numbers::pi * rho2;
      sums[0] += area;
      sums[1] += area * s;
      sums[2] += area * s * s;
      sums[3] += 0.25 * area * rho2;
    }
  };
  add(-a.radius, plane, 0, a.radius);
  add(plane, d + b.radius, d, b.radius);
  RawMoments m{.volume = sums[0]};
  for (std::size_t i = 0; i < 3; ++i) {
    m.first[i] = sums[1] * axis[i];
    for (std::size_t j = 0; j < 3; ++j) {
      const double along = axis[i] * axis[j];
      m.second[i][j] = sums[2] * along + sums[3] * ((i == j ? 1.0 : 0.0) - along);
    }
  }
  return m;
}

/// Whether two spheres cut each other, the first at the origin: neither apart nor one inside.
bool Cut(const Sphere& a, const Sphere& b) {
  const double d = Hypotenuse(b.centre[0], b.centre[1], b.centre[2]);
  return d < a.radius + b.radius && d > std::abs(a.radius - b.radius);
}

RawMoments IntegrateLines(const std::vector<Sphere>& spheres) {
  double low[2] = {std::numeric_limits<double>::infinity(),
                   std::numeric_limits<double>::infinity()};
  double high[2] = {-low[0], -low[1]};
  for (const Sphere& s : spheres) {
    for (std::size_t a = 0; a < 2; ++a) {
      low[a] = std::min(low[a], s.centre[a + 1] - s.radius);
      high[a] = std::max(high[a], s.centre[a + 1] + s.radius);
    }
  }
  const double dy = (high[0] - low[0]) / kLines;
  const double dz = (high[1] - low[1]) / kLines;
  RawMoments m;
  std::vector<std::pair<double, double>> found;
  std::vector<std::pair<double, double>> merged;
  for (int row = 0; row < kLines; ++row) {
    for (int column = 0; column < kLines; ++column) {
      const double y = low[0] + (column + 0.5) * dy;
      const double z = low[1] + (row + 0.5) * dz;
      found.clear();
      for (const Sphere& s : spheres) {
        const double h2 = s.radius * s.radius - (y - s.centre[1]) * (y - s.centre[1]) -
                          (z - s.centre[2]) * (z - s.centre[2]);
        if (h2 > 0) {
          const double h = std::sqrt(h2);
          found.emplace_back(s.centre[0] - h, s.centre[0] + h);
        }
      }
      std::sort(found.begin(), found.end());
      merged.clear();
      for (const auto& interval : found) {
        if (!merged.empty() && interval.first <= merged.back().second) {
          merged.back().second = std::max(merged.back().second, interval.second);
        } else {
          merged.push_back(interval);
        }
      }
      AddLine(merged, y, z, dy * dz, m);
    }
  }
  m.second[1][0] = m.second[0][1];
  m.second[2][0] = m.second[0][2];
  m.second[2][1] = m.second[1][2];
  return m;
}

}  // namespace

SolidMoments MomentsOfUnion(const std::vector<Sphere>& spheres) {
  // About the first centre: coordinates far from the origin would cost digits.
  std::vector<Sphere> local = spheres;
  for (Sphere& s : local) {
    for (std::size_t a = 0; a < 3; ++a) {
      s.centre[a] -= spheres.front().centre[a];
    }
  }
  const bool pair = local.size() == 2 && Cut(local[0], local[1]);
  const RawMoments raw = !AnyOverlap(local) ? AddUp(local)
                         : pair             ? Revolve(local[0], local[1])
                                            : IntegrateLines(local);
  SolidMoments moments{.volume = raw.volume};
  Vector c{};
  for (std::size_t a = 0; a < 3; ++a) {
    c[a] = raw.first[a] / raw.volume;
    moments.centroid[a] = spheres.front().centre[a] + c[a];
  }
  Tensor central{};
  for (std::size_t a = 0; a < 3; ++a) {
    for (std::size_t b = 0; b < 3; ++b) {
      central[a][b] = raw.second[a][b] - raw.volume * c[a] * c[b];
    }
  }
  const double trace = central[0][0] + central[1][1] + central[2][2];
  for (std::size_t a = 0; a < 3; ++a) {
    for (std::size_t b = 0; b < 3; ++b) {
      moments.inertia[a][b] = (a == b ? trace : 0.0) - central[a][b];
    }
  }
  return moments;
}

PrincipalMoments Diagonalize(Tensor t) {
  Tensor v = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};  // columns become the axes
  for (int sweep = 0; sweep < 50; ++sweep) {
    const double off = std::abs(t[0][1]) + std::abs(t[0][2]) + std::abs(t[1][2]);
    if (off <= 1e-16 * (std::abs(t[0][0]) + std::abs(t[1][1]) + std::abs(t[2][2]))) {
      break;
    }
    for (std::size_t p = 0; p < 2; ++p) {
      for (std::size_t q = p + 1; q < 3; ++q) {
        if (t[p][q] == 0) {
          continue;
        }
        const double theta = (t[q][q] - t[p][p]) / (2.0 * t[p][q]);
        const double tangent =
            (theta >= 0 ? 1.0 : -1.0) / (std::abs(theta) + std::sqrt(theta * theta + 1.0));
        const double cosine = 1.0 / std::sqrt(tangent * tangent + 1.0);
        const double sine = tangent * cosine;
        for (std::size_t k = 0; k < 3; ++k) {
          const double tkp = t[k][p];
          const double tkq = t[k][q];
          t[k][p] = cosine * tkp - sine * tkq;
          t[k][q] = sine * tkp + cosine * tkq;
        }
        for (std::size_t k = 0; k < 3; ++k) {
          const double tpk = t[p][k];
          const double tqk = t[q][k];
          t[p][k] = cosine * tpk - sine * tqk;
          t[q][k] = sine * tpk + cosine * tqk;
          const double vkp = v[k][p];
          const double vkq = v[k][q];
          v[k][p] = cosine * vkp - sine * vkq;
          v[k][q] = sine * vkp + cosine * vkq;
        }
      }
    }
  }
  std::array<std::size_t, 3> order = {0, 1, 2};
  std::sort(order.begin(), order.end(),
            [&t](std::size_t a, std::size_t b) { return t[a][a] < t[b][b]; });
  PrincipalMoments result;
  for (std::size_t k = 0; k < 3; ++k) {
    result.moment[k] = t[order[k]][order[k]];
    for (std::size_t a = 0; a < 3; ++a) {
      result.axes[k][a] = v[a][order[k]];
    }
  }
  auto& [x, y, z] = result.axes;
  const double handed = z[0] * (x[1] * y[2] - x[2] * y[1]) + z[1] * (x[2] * y[0] - x[0] * y[2]) +
                        z[2] * (x[0] * y[1] - x[1] * y[0]);
  if (handed < 0) {
    for (double& component : z) {
      component = -component;
    }
  }
  return result;
}

}  // namespace calib::dem
