#pragma once
// A contact law as data: its catalogue entry and what makes its kernels.

#include <memory>
#include <string>
#include <vector>

#include "dem/model/effect.h"
#include "dem/model/parameter.h"

namespace calib::dem {

struct ContactInfo {
  std::string name;
  std::string description;
  std::vector<ParameterInfo> parameters;
  std::string reference;
};

/// A contact law; its kernel runs at ContactStage::kNormal, friction and shear spring follow for
/// every law. A dashpot, where there is one, runs at the end of kNormalExtra.
struct ContactEntry {
  ContactInfo info;
  int place = 1000;  ///< laws are listed in this order, then by name
  MakeKernel make = nullptr;
  MakeKernel make_dashpot = nullptr;
};

}  // namespace calib::dem
