#pragma once
// The manual of calibctl: a page of all verbs, and one for each.

#include <string>
#include <utility>
#include <vector>

#include "server/ctl/shell/command_tree.h"

namespace calib::ctl {

/// (name of the file, page as man(7) source): calibctl.1, then calibctl-VERB.1. Pure.
std::vector<std::pair<std::string, std::string>> ManPages(const CommandTree& tree);

}  // namespace calib::ctl
