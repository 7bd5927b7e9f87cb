#pragma once
// `load_cell_error`: gain and zero of the load cell.

#include "dem/catalog/registry.h"

namespace calib::dem {

///   sigma_a reported = sigma_a + g x + s0,   x as in apparatus_compliance
/// The cell is taken to zero at the start of loading; what it then reads is wrong by a factor and
/// by a shift. Changes reports only, not the test. Two-sided, vanishes at g = 0 and s0 = 0. [ASTM
/// E74]
EffectEntry LoadCellError();

}  // namespace calib::dem
