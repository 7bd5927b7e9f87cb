#pragma once
// Version of the mechanics.

#include <string>

namespace calib::dem {

/// Version of the mechanics: changes whenever the same scenario may give other bits.
std::string EngineVersion();

}  // namespace calib::dem
