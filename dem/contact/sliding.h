#pragma once
// Coulomb friction with a tangential spring: the part that all contact laws share.

#include <memory>

#include "dem/contact/contact_kernel.h"
#include "dem/model/model.h"

namespace calib::dem {

/// Kernel of Coulomb's limit: the largest shear force is tan(phi_mu) (Fn + attraction), zero where
/// that sum pulls; with several materials tan(phi_mu) is that of the pair. [Cheng 2018, Table 1]
std::unique_ptr<ContactKernel> MakeCoulombLimit();

/// Kernel of the tangential spring: incremental shear force dFs = -ks slip, carried along with the
/// contact and cut back to sliding_limit. [Cheng 2018, Eq. 2] Where ks falls, as at unloading,
///   as published: the force stays. A closed cycle of slip and unloading can give work: the spring
///                 gains Fs^2/2 (1/k_new - 1/k_old). [Elata & Berryman, Mech. Mater. 24 (1996) 229]
///   rescaled:     Fs k_new/k_old first, as if the spring kept its length. With E = Fs^2/(2 ks),
///                 dE = -Fs slip - Fs^2 |dks|/(2 ks^2), ks falling or rising: no cycle gives work,
///                 and of what the spring held a part is lost, since the normal force does not feel
///                 it. [Thornton, Cummins & Cleary, Powder Technol. 233 (2013) 30]
/// History: the shear force on j [N] (3 doubles); rescaled: then the ks of the step before [N/m].
std::unique_ptr<ContactKernel> MakeTangentialSpring(ShearUnloading unloading);

}  // namespace calib::dem
