#pragma once
// The commonest chains of kernels in one pass over the lanes of a block, so that what one kernel
// leaves for the next stays in registers: `hertz_mindlin` or `linear` with Coulomb's limit and the
// shear spring, alone, with rolling_resistance, or with rolling_resistance and twisting_resistance;
// any of them with viscous_damping. Grains of one material, shear as published.

#include <cstdint>
#include <optional>

#include "dem/contact/contact_block.h"
#include "dem/effects/shared/moment_stiffness.h"
#include "dem/effects/viscous_damping.h"
#include "dem/model/model.h"
#include "dem/model/model_entries.h"

namespace calib::dem {

/// One of the commonest chains. Immutable once made; may be shared between threads.
struct CommonChain {
  bool hertz = true;      ///< hertz_mindlin; false: linear
  double normal = 0;      ///< kn = normal sqrt(r* u), with linear kn = normal r* [Pa]
  double tangential = 0;  ///< ks = tangential sqrt(r* u) [Pa], with linear ks = tangential kn [-]
  std::optional<MomentLaw> rolling, twisting;  ///< twisting only beside rolling
  std::optional<Dashpot> dashpot;
};

/// The chain of a model where it is one of the commonest, which the head of this file lists; else
/// empty. thickness: of disks [m]; 0: spheres.
std::optional<CommonChain> CommonChainOf(const Model& model, const ModelEntries& entries,
                                         double thickness = 0);

/// Does what ContactModel::Evaluate() and CloseBlock() (pair_blocks.h) do together, with the same
/// bits: overlap, forces, torques and memory of all lanes; zero where the lane does not overlap or
/// is not in use. Columns of memory: shear force, rolling moment, twisting moment. Sets touching
/// (kBlock of them) and returns how many lanes overlap. Stiffnesses are not set;
/// CommonChainStiffness() does.
int EvaluateCommonChain(const CommonChain& chain, ContactBlock& block, std::uint8_t* touching);

/// Sets normals, overlap, all stiffnesses and dampings of a block, with the bits of
/// ContactModel::Evaluate() where lanes overlap. Neither memory nor velocities are read.
void CommonChainStiffness(const CommonChain& chain, ContactBlock& block);

}  // namespace calib::dem
