#pragma once
// surrogate_msrs: a search for the best fit on a response surface [Regis & Shoemaker 2007;
// Samuelsson 2023, Sec. 3].

#include <memory>

#include "server/campaign/model/method.h"

namespace calib::methods {

std::shared_ptr<const campaign::Method> MakeSurrogateMsrs();

}  // namespace calib::methods
