#include "dem/particles/elongation.h"

#include <Random123/philox.h>

#include <cmath>
#include <cstdint>
#include <numbers>

#include "dem/elementary/functions.h"
#include "dem/particles/random_numbers.h"

namespace calib::dem {
namespace {

/// Uniform direction of grain i.
void DrawDirection(int grain, double* axis) {
  const auto bits =
      r123::Philox4x32()({{kElongationDraw, static_cast<std::uint32_t>(grain), 0, 0}}, {{0, 0}});
  const double z = 2.0 * bits[0] / 4294967296.0 - 1.0;
  const double phi = 2.0 * std::numbers::pi * bits[1] / 4294967296.0;
  const double across = std::sqrt(1.0 - z * z);
  axis[0] = across * Cosine(phi);
  axis[1] = across * Sine(phi);
  axis[2] = z;
}

}  // namespace

Dumbbell DumbbellOf(double aspect) {
  const double c = aspect - 1.0;  // offset over radius
  const double over_r3 = 8.0 / 3.0 - (4.0 + 2.0 * c) * (2.0 - 2.0 * c) * (2.0 - 2.0 * c) / 12.0;
  const double radius = CubeRoot(4.0 / 3.0 / over_r3);
  return {.radius = radius, .offset = c * radius};
}

Packing Elongated(const Packing& spheres, double aspect) {
  const Dumbbell shape = DumbbellOf(aspect);
  Packing packing;
  for (int a = 0; a < 3; ++a) {
    packing.length[a] = spheres.length[a];
  }
  for (std::size_t i = 0; i < spheres.x.size(); ++i) {
    double axis[3];
    DrawDirection(static_cast<int>(i), axis);
    for (const double side : {-1.0, 1.0}) {
      const double offset = side * shape.offset * spheres.radius[i];
      packing.x.push_back(spheres.x[i] + offset * axis[0]);
      packing.y.push_back(spheres.y[i] + offset * axis[1]);
      packing.z.push_back(spheres.z[i] + offset * axis[2]);
      packing.radius.push_back(shape.radius * spheres.radius[i]);
      packing.clump.push_back(static_cast<int>(i));
    }
  }
  return packing;
}

}  // namespace calib::dem
