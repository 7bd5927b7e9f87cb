#pragma once
// The calibration methods of this build.

#include "server/campaign/model/method.h"

namespace calib::methods {

/// Each method's room is named here and nowhere else. Thread-safe; lives as long as the program.
const campaign::MethodList& All();

}  // namespace calib::methods
