#include "server/ctl/next_step.h"

#include "absl/strings/str_cat.h"

namespace calib::ctl {
namespace {

std::string ShellWord(const std::string& word) {
  const bool plain = !word.empty() && word.find_first_not_of(
                                          "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
                                          "0123456789_-./:,+=@%") == std::string::npos;
  if (plain) return word;
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

}  // namespace

std::string CommandOf(const client::ServerChoice& server, const std::string& words) {
  std::string command = absl::StrCat("calibctl ", words);
  if (!server.state.empty()) {
    absl::StrAppend(&command, " --state ", ShellWord(server.state));
  } else if (server.given) {
    absl::StrAppend(&command, " --server ", ShellWord(server.address));
  }
  if (!server.tls.empty()) absl::StrAppend(&command, " --tls ", ShellWord(server.tls));
  if (!server.token.empty()) absl::StrAppend(&command, " --token ", ShellWord(server.token));
  return command;
}

std::string NextStep(const std::string& command, const std::string& what_it_says) {
  return absl::StrCat("\nNext: ", command, "\n      ", what_it_says, "\n");
}

}  // namespace calib::ctl
