#pragma once
// `isotropic`: the mean stress driven, all three axes at the same stress.

#include "dem/catalog/registry.h"

namespace calib::dem {

ElementTestEntry Isotropic();

}  // namespace calib::dem
