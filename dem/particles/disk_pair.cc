#include "dem/particles/disk_pair.h"

#include <cassert>
#include <cmath>
#include <numbers>

#include "dem/elementary/functions.h"

namespace calib::dem {

// The line half-way between the centres cuts the union into two equal halves; each is a disk from
// u = -offset to radius, of half height h(u) = sqrt(r^2 - u^2).
PlateMoments MomentsOfDiskPair(double radius, double offset) {
  assert(radius > 0 && offset >= 0 && offset <= radius);
  const double r2 = radius * radius;
  const double c = offset;
  const double h = std::sqrt(r2 - c * c);
  const double segment = c * h + r2 * Direction(c, h);
  const double quarter = 0.5 * std::numbers::pi * r2;
  const double of_h = 0.5 * (quarter + segment);
  const double of_uh = h * h * h / 3;
  const double of_uuh = (r2 * quarter + c * (2 * c * c - r2) * h + r2 * r2 * Direction(c, h)) / 8;
  const double of_hhh = 0.375 * r2 * (quarter + segment) + 0.25 * c * h * h * h;
  const double along = 2 * (of_uuh + 2 * c * of_uh + c * c * of_h);
  const double across = 2.0 / 3.0 * of_hhh;
  return {.area = 4 * of_h, .polar = 2 * (along + across)};
}

ClumpTemplate DiskPairTemplate(double aspect) {
  const double radius = std::sqrt(std::numbers::pi / MomentsOfDiskPair(1.0, aspect - 1.0).area);
  const double offset = (aspect - 1.0) * radius;
  return {{{{0, 0, -offset}, radius}, {{0, 0, offset}, radius}}};
}

}  // namespace calib::dem
