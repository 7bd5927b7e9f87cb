#include "dem/particles/particle_arrays.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <tuple>

namespace calib::dem {
namespace {

/// Permutation that lists the grains slab by slab, row by row.
std::vector<int> SpatialOrder(const Packing& packing) {
  const auto n = packing.x.size();
  const double edge = 2 * *std::max_element(packing.radius.begin(), packing.radius.end());
  const auto slab = [&](double s) { return static_cast<long>(std::floor(s / edge)); };
  std::vector<int> order(n);
  std::iota(order.begin(), order.end(), 0);
  const auto key = [&](int i) {
    return std::tuple(slab(packing.z[i]), slab(packing.y[i]), packing.x[i], packing.y[i],
                      packing.z[i], packing.radius[i], i);
  };
  std::sort(order.begin(), order.end(), [&](int a, int b) { return key(a) < key(b); });
  return order;
}

}  // namespace

Inertia InertiaOf(double radius, double density, double thickness) {
  const double r = radius;
  if (thickness > 0) {
    const double mass = density * std::numbers::pi * r * r * thickness;
    return {.mass = mass, .moment = 0.5 * mass * r * r};
  }
  const double mass = density * 4.0 / 3.0 * std::numbers::pi * r * r * r;
  return {.mass = mass, .moment = 0.4 * mass * r * r};
}

ParticleArrays MakeParticles(const Packing& packing, double density, double thickness) {
  const auto n = packing.x.size();
  ParticleArrays p;
  p.id = SpatialOrder(packing);
  for (auto* a : {&p.x, &p.y, &p.z, &p.vx, &p.vy, &p.vz, &p.wx, &p.wy, &p.wz, &p.fx, &p.fy, &p.fz,
                  &p.tx, &p.ty, &p.tz, &p.radius, &p.inverse_mass, &p.inverse_inertia}) {
    a->assign(n, 0.0);
  }
  for (std::size_t k = 0; k < n; ++k) {
    const int i = p.id[k];
    const double r = packing.radius[i];
    const Inertia inertia = InertiaOf(r, density, thickness);
    p.x[k] = packing.x[i];
    p.y[k] = packing.y[i];
    p.z[k] = packing.z[i];
    p.radius[k] = r;
    p.inverse_mass[k] = 1.0 / inertia.mass;
    p.inverse_inertia[k] = 1.0 / inertia.moment;
  }
  return p;
}

}  // namespace calib::dem
