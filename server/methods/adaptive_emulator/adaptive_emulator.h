#pragma once
// adaptive_emulator: runs go where the posterior is least certain [Sinsbeck & Nowak 2017; Järvenpää
// et al. 2021].

#include <memory>

#include "server/campaign/model/method.h"

namespace calib::methods {

std::shared_ptr<const campaign::Method> MakeAdaptiveEmulator();

}  // namespace calib::methods
