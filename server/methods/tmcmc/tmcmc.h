#pragma once
// tmcmc: transitional Markov chain Monte Carlo [Ching & Chen 2007; Hadjidoukas et al. 2014, Sec. 3].

#include <memory>

#include "server/campaign/model/method.h"

namespace calib::methods {

std::shared_ptr<const campaign::Method> MakeTmcmc();

}  // namespace calib::methods
