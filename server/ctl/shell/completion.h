#pragma once
// Scripts that let a shell complete command lines of calibctl.

#include <string>

#include "server/ctl/shell/command_tree.h"

namespace calib::ctl {

enum class Shell { kBash, kZsh, kFish };

/// Completes verbs, their options and, in place of values, names of files. Pure.
///   bash: source it, or put it into ~/.local/share/bash-completion/completions/calibctl
///   zsh:  put it as _calibctl into a folder of $fpath
///   fish: put it into ~/.config/fish/completions/calibctl.fish
std::string CompletionScript(Shell shell, const CommandTree& tree);

}  // namespace calib::ctl
