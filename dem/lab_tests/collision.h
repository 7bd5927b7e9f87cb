#pragma once
// `collision`: one body hits a wall or another body at rest.

#include <string>
#include <vector>

#include "dem/catalog/catalog.h"

namespace calib::dem {

/// Smallest angle that a collision is computed at [rad]: tangential restitution at normal incidence
/// is its limit for small angles.
inline constexpr double kSmallestImpactAngle = 1e-6;

/// A body of `radius` hits a body of the same material at rest, of `partner_radius` (infinite: a
/// flat wall that does not move), free of gravity. Spheres; with a `thickness` disks that move in
/// their plane (mass rho pi r^2 t, inertia m r^2/2) under the same law of force. Driven by
/// impact_angle, impact_speed or impact_spin: the one that is not a setting. [Hadjidoukas et al.
/// 2014, sec. 4]
TestInfo Collision();

/// The control of a collision with these settings: the first of the three that is not among them.
std::string CollisionControl(const std::map<std::string, double>& settings);

}  // namespace calib::dem
