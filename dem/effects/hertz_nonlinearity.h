#pragma once
// `hertz_nonlinearity`: an exponent of the contact force other than that of the law.

#include "dem/catalog/registry.h"

namespace calib::dem {

///   F = F_b(u_ref) (u/u_ref)^n,   ks = ks_b (dF/du)/(dF_b/du),   F_b(u_ref) = p_ref d*^2,
///   d* = 4 r* (= d of equal grains)
/// F_b is the force of the law, of exponent m (linear: 1, hertz_mindlin: 3/2), and u_ref the
/// overlap at which it carries the force that a reference pressure puts on a contact: about p d^2,
/// since p = Z phi F/(pi d^2) [Rumpf 1958] with coordination number times solid fraction near pi.
/// In terms of the law's force F = F_b (F_b/(p_ref d*^2))^((n-m)/m), so no modulus enters.
/// The shear stiffness goes with the tangent of the force: for elastic bodies of any axisymmetric
/// profile their ratio is that of Mindlin, 2(1-nu)/(2-nu) [Jaeger, Arch. Appl. Mech. 65 (1995)
/// 478]. Two-sided, vanishes at n = m. Below a thousandth of the reference force (n < m) the factor
/// is held, since stiffness would grow without bound as u -> 0. [Walton 1987; Agnolin & Roux 2007,
/// sec. II, on the exponent's part in elastic moduli of packings]
EffectEntry HertzNonlinearity();

}  // namespace calib::dem
