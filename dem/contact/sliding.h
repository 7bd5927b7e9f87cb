#pragma once
// Coulomb friction with a tangential spring: the part that all contact laws share.

#include <memory>

#include "dem/contact/contact_kernel.h"

namespace calib::dem {

/// Kernel of Coulomb's limit: the largest shear force is tan(phi_mu) (Fn + attraction), zero where
/// that sum pulls; with several materials tan(phi_mu) is that of the pair. [Cheng 2018, Table 1]
std::unique_ptr<ContactKernel> MakeCoulombLimit();

/// Kernel of the tangential spring: incremental shear force dFs = -ks slip, carried along with the
/// contact and cut back to sliding_limit; it is not rescaled when the overlap shrinks. History: the
/// shear force on j [N] (3 doubles). [Cheng 2018, Eq. 2]
std::unique_ptr<ContactKernel> MakeTangentialSpring();

}  // namespace calib::dem
