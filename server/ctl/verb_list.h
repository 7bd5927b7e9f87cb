#pragma once
// Which verbs calibctl has.

#include <vector>

#include "server/ctl/verb.h"

namespace calib::ctl {

/// All verbs of calibctl in the order of `calibctl --help`, their options at their defaults.
std::vector<Verb> AllVerbs();

}  // namespace calib::ctl
