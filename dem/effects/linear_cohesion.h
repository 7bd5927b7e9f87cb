#pragma once
// `linear_cohesion`: attraction in proportion to the area of contact.

#include "dem/catalog/registry.h"

namespace calib::dem {

///   F = F_b - C A,   A = 2 pi r* u
/// A is the circle in which two spheres cut each other, to first order, C a cohesion energy density
/// [J/m^3 = Pa]. Sliding limit tan(phi_mu) (F + C A). With linear contacts CA/F_b = pi C/E whatever
/// the load: a softer spring with more friction. Hertz contacts, whose force falls faster than
/// their area, are held together below an overlap of r* (2 pi C/(kn/sqrt(r* u)))^2. One-sided,
/// vanishes at C = 0. Acts while grains overlap.
/// [Luding 2008, sec. 2.2.2, on tension that grows with overlap; Johnson 1985, sec. 5.5]
EffectEntry LinearCohesion();

}  // namespace calib::dem
