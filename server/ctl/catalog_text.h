#pragma once
// The parameters of contacts, effects and tests as tables.

#include <string>
#include <vector>

#include "dem/catalog/catalog.h"

namespace calib::ctl {

/// "  young_modulus  Pa  10000 .. 1e+13  log_uniform 100 MPa .. 100 GPa  Young's modulus ...", one
/// line each.
std::string ParameterTable(const std::vector<dem::ParameterInfo>& parameters);

}  // namespace calib::ctl
