#include "server/ctl/shell/completion.h"

#include <iostream>
#include <map>
#include <string>

#include "absl/strings/str_cat.h"
#include "server/ctl/command_line.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"
#include "server/ctl/verb_list.h"

namespace calib::ctl {
namespace {

struct CompletionOptions {
  std::string shell;
};

void Declare(OptionList& list, CompletionOptions& options) {
  list.Text("SHELL", options.shell, "bash, zsh or fish").Required();
}

absl::StatusOr<int> Completion(const CommonOptions& /*common*/, const CompletionOptions& options) {
  static const std::map<std::string, Shell> shells = {
      {"bash", Shell::kBash}, {"zsh", Shell::kZsh}, {"fish", Shell::kFish}};
  const auto shell = shells.find(options.shell);
  if (shell == shells.end()) {
    return absl::InvalidArgumentError(
        absl::StrCat("SHELL: '", options.shell, "' is not bash, zsh or fish"));
  }
  std::cout << CompletionScript(shell->second, DescribeCommands(AllVerbs()));
  return kDone;
}

}  // namespace

Verb CompletionVerb() {
  return MakeVerb<CompletionOptions>(
      {.name = "completion",
       .description = "The script that lets a shell complete these commands",
       .example = "completion bash > ~/.local/share/bash-completion/completions/calibctl"},
      &Declare, &Completion);
}

}  // namespace calib::ctl
