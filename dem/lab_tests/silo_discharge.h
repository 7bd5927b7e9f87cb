#pragma once
// `silo_discharge`: grains leave through an outlet, arches stop them.

#include "dem/catalog/registry.h"

namespace calib::dem {

GravityTestEntry SiloDischarge();

}  // namespace calib::dem
