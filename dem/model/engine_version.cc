#include "dem/model/engine_version.h"

namespace calib::dem {

std::string EngineVersion() { return "15"; }

}  // namespace calib::dem
