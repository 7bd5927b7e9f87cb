#pragma once
// sqmc: the sequential quasi-Monte Carlo filter, one iteration [Cheng et al. 2018].

#include <memory>

#include "server/campaign/model/method.h"

namespace calib::methods {

std::shared_ptr<const campaign::Method> MakeSqmc();

}  // namespace calib::methods
