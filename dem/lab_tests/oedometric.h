#pragma once
// `oedometric`: axial strain driven, no lateral strain.

#include "dem/catalog/registry.h"

namespace calib::dem {

ElementTestEntry Oedometric();

}  // namespace calib::dem
