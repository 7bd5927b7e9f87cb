#pragma once
// Parameters that mean the same in several effects.

#include <string>

#include "dem/model/effect.h"

namespace calib::dem {

/// Catalogue entry of reference_pressure p_ref [Pa], default 100 kPa; `description` says what holds
/// at it.
ParameterInfo ReferencePressure(const std::string& description);

/// Catalogue entry of work_of_adhesion W [J/m^2], scaled by p d, so that the pull-off force over p
/// d^2 is about one.
ParameterInfo WorkOfAdhesion();

}  // namespace calib::dem
