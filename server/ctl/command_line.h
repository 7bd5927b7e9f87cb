#pragma once
// The command line of calibctl: verbs, options, help. The only place that knows the argument
// library.

#include <functional>
#include <optional>
#include <string>

#include "server/ctl/arguments.h"

namespace calib::ctl {

using Verb = std::function<int(const Arguments&)>;

struct Command {
  Verb verb;
  Arguments arguments;
};

/// The command, or the exit code when there is nothing more to do (help was shown, or the usage was
/// wrong).
struct Parsed {
  std::optional<Command> command;
  int exit_code = 0;
};
Parsed ParseCommandLine(int argc, const char* const* argv);

}  // namespace calib::ctl
