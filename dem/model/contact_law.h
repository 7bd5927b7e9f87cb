#pragma once
// A contact law as data: its catalogue entry and what makes its kernels.

#include <memory>
#include <string>
#include <vector>

#include "dem/model/effect.h"
#include "dem/model/parameter.h"

namespace calib::dem {

/// Catalogue entry of a contact law.
struct ContactInfo {
  std::string name;  ///< as users write it, "hertz_mindlin"
  std::string description;
  std::vector<ParameterInfo> parameters;  ///< all of the law, with SI units and ranges
  std::string reference;                  ///< paper and equations
  bool linear_springs = false;  ///< the elastic normal force grows in proportion to the overlap, as
                                ///< of a linear spring
};

/// A contact law as the registry holds it: catalogue entry and kernels. The kernel of `make` runs
/// at ContactStage::kNormal; Coulomb's limit and the shear spring, which are no part of a law,
/// follow it.
struct ContactEntry {
  ContactInfo info;
  int place = 1000;                   ///< laws are listed in this order, then by name
  MakeKernel make = nullptr;          ///< sets normal force and stiffnesses; never null in a list
  MakeKernel make_dashpot = nullptr;  ///< runs last in kNormalExtra; null: the law has no dashpot
};

}  // namespace calib::dem
