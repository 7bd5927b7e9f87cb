#pragma once
// design: runs that are added while the campaign lives, each with some effects of a race; nothing
// is inferred here (server/diagnosis does).

#include <memory>

#include "server/campaign/model/method.h"

namespace calib::methods {

std::shared_ptr<const campaign::Method> MakeDesign();

}  // namespace calib::methods
