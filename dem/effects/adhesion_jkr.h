#pragma once
// `adhesion_jkr`: elastic grains with adhesion inside their circle of contact.

#include "dem/catalog/registry.h"

namespace calib::dem {

/// With the contact radius a, E* = E/(2(1-nu^2)) and R* = r1 r2/(r1 + r2):
///   u = a^2/R* - sqrt(2 pi W a/E*),   F = 4 E* a^3/(3 R*) - sqrt(8 pi W E* a^3)
/// Pull-off 3/2 pi W R*. A contact forms at u = 0 with F = -4/3 pi W R* and, once formed, holds
/// down to u = -3 a_c^2/R*, a_c^3 = pi W R*^2/(8 E*), where F = -5/6 pi W R*: making and breaking
/// it costs energy. In units of a_c, with z = sqrt(a/a_c) >= 1:
///   u R*/a_c^2 = z^4 - 4z,   F/(pi W R*) = z^6/6 - z^3,
/// z by Newton's method, always from above. The difference to Hertz joins the force of the law, and
/// the shear stiffness grows with a. Sliding limit tan(phi_mu) (F + 3/2 pi W R*). One-sided,
/// vanishes at W = 0. [Johnson, Kendall & Roberts 1971; Johnson 1985, sec. 5.5]
EffectEntry AdhesionJkr();

}  // namespace calib::dem
