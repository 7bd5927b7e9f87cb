#pragma once
// What the three viscoelastic laws share: an elastic Hertz contact, a dashpot that grows with the
// overlap, a tangential spring of constant stiffness.

#include <string>
#include <vector>

#include "dem/model/effect.h"

namespace calib::dem {

/// Exponent of the overlap in the dashpot of a viscoelastic contact
///   F = k u^{3/2} + gamma u' u^alpha,   k = 4/3 E* sqrt(r*),   E* = E/(2(1 - nu^2))
///   dFs = k_t dus,   |Fs| <= tan(phi_mu) |F|
/// u' is the rate of overlap. F may pull for the last moments of a collision, and friction is
/// limited by its size then too. The dashpot acts on top of everything that effects make of the
/// elastic force; it is off during consolidation.
/// [Hadjidoukas et al. 2014, Table 1, Eq. 3]
struct ViscoelasticExponent {
  enum class Kind { kQuarter, kHalf, kGiven };
  Kind kind = Kind::kGiven;
  double value = 0;  ///< alpha, where given [-] >= 0
};

/// Kernel of the springs, from the parameters young_modulus, poisson_ratio and
/// tangential_stiffness.
std::unique_ptr<ContactKernel> MakeViscoelasticSprings(const KernelContext& context);
/// Kernel of the dashpot, from the parameter damping (gamma).
std::unique_ptr<ContactKernel> MakeViscoelasticDashpot(const KernelContext& context,
                                                       const ViscoelasticExponent& exponent);

/// Catalogue entries of young_modulus, poisson_ratio, tangential_stiffness, damping [damping_unit],
/// friction_angle and friction_coefficient.
std::vector<ParameterInfo> ViscoelasticParameters(const std::string& damping_unit);

}  // namespace calib::dem
