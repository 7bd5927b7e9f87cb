#pragma once
// `transfer_chute`: a belt, a funnel and a divider that splits the flow.

#include "dem/catalog/registry.h"

namespace calib::dem {

GravityTestEntry TransferChute();

}  // namespace calib::dem
