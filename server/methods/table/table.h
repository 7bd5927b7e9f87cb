#pragma once
// table: the rows of the campaign file are run, and nothing is inferred.

#include <memory>

#include "server/campaign/model/method.h"

namespace calib::methods {

std::shared_ptr<const campaign::Method> MakeTable();

}  // namespace calib::methods
