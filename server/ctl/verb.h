#pragma once
// A verb of calibctl: how it stands on the command line and what it does.

#include <functional>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "server/client/server_choice.h"

namespace calib::ctl {

class OptionList;

/// What every verb takes.
struct CommonOptions {
  client::ServerChoice server;
  bool json = false;  ///< one JSON document on standard output
};

struct VerbHelp {
  std::string name;
  std::string description;        ///< one line
  std::string example;            ///< a use of the verb, without "calibctl "
  bool speaks_of_errors = false;  ///< the help says what an error is
};

struct Verb {
  VerbHelp help;
  /// Names the verb's own options and where their values go; empty: it has none.
  std::function<void(OptionList&)> declare{};
  /// Called once the command line is read. Prints the answer and returns the exit code of calibctl
  /// (exit_codes.h), or a status, which main prints and turns into one.
  std::function<absl::StatusOr<int>(const CommonOptions&)> run;
};

/// A verb with options of its own. `declare` and `run` see the same Options, which begin as their
/// defaults.
template <typename Options>
Verb MakeVerb(const VerbHelp& help, void (*declare)(OptionList&, Options&),
              absl::StatusOr<int> (*run)(const CommonOptions&, const Options&)) {
  const auto options = std::make_shared<Options>();
  return {
      .help = help,
      .declare = [declare, options](OptionList& list) { declare(list, *options); },
      .run = [run, options](const CommonOptions& common) { return run(common, *options); },
  };
}

}  // namespace calib::ctl
