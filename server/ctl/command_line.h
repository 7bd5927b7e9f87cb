#pragma once
// The command line of calibctl: which verb, with which options, or help. With option_list the only
// place that knows the argument library.

#include <optional>
#include <vector>

#include "server/ctl/shell/command_tree.h"
#include "server/ctl/verb.h"

namespace calib::ctl {

struct Command {
  Verb verb;
  CommonOptions common;
};

/// The command, or the exit code when there is nothing more to do (help was shown, or the usage was
/// wrong).
struct Parsed {
  std::optional<Command> command;
  int exit_code = 0;
};
/// Reads a command line with one of `verbs`; writes help to standard output and what is wrong to
/// standard error.
Parsed ParseCommandLine(const std::vector<Verb>& verbs, int argc, const char* const* argv);

/// The same command line, for completions and man pages.
CommandTree DescribeCommands(const std::vector<Verb>& verbs);

}  // namespace calib::ctl
