#pragma once
// The command that a user may type next.

#include <string>

#include "server/client/server_choice.h"

namespace calib::ctl {

/// "calibctl WORDS" with the --state or --server of `server`, quoted for a shell where need be.
std::string CommandOf(const client::ServerChoice& server, const std::string& words);

/// A line for the end of an answer: "Next: calibctl diagnose c1 --state s   which effect is
/// missing".
std::string NextStep(const std::string& command, const std::string& what_it_says);

}  // namespace calib::ctl
