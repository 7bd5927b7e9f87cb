#pragma once
// iterative_bayesian_filter: weighted samples of several iterations [Cheng et al. 2019].

#include <memory>

#include "server/campaign/model/method.h"

namespace calib::methods {

std::shared_ptr<const campaign::Method> MakeIterativeBayesianFilter();

}  // namespace calib::methods
