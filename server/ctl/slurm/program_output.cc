#include "server/ctl/slurm/program_output.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <iterator>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/client/temporary_folder.h"

extern char** environ;  // NOLINT(readability-redundant-declaration): POSIX leaves it to the program

namespace calib::ctl {
namespace {

std::string ReadFile(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::string LastLine(const std::string& text) {
  const std::string trimmed(absl::StripTrailingAsciiWhitespace(text));
  return trimmed.substr(trimmed.rfind('\n') + 1);  // npos + 1 is 0
}

}  // namespace

absl::StatusOr<std::string> OutputOf(const std::vector<std::string>& command) {
  ASSIGN_OR_RETURN(const client::TemporaryFolder folder, client::TemporaryFolder::Make());
  const std::string out = folder.path() + "/out";
  const std::string err = folder.path() + "/err";
  std::vector<std::string> texts = command;
  std::vector<char*> argv;
  argv.reserve(texts.size() + 1);
  for (std::string& text : texts) argv.push_back(text.data());
  argv.push_back(nullptr);

  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  constexpr int kNew = O_WRONLY | O_CREAT | O_TRUNC;
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, out.c_str(), kNew, S_IRUSR | S_IWUSR);
  posix_spawn_file_actions_addopen(&files, STDERR_FILENO, err.c_str(), kNew, S_IRUSR | S_IWUSR);
  pid_t pid = -1;
  const int error = posix_spawnp(&pid, argv[0], &files, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  if (error == ENOENT) {
    return absl::NotFoundError(absl::StrCat(command[0], " is not installed on this machine"));
  }
  if (error != 0) {
    return absl::InternalError(
        absl::StrCat(command[0], " cannot be started: ", std::generic_category().message(error)));
  }
  int status = 0;
  while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return ReadFile(out);
  const std::string why = LastLine(ReadFile(err));
  return absl::InternalError(
      absl::StrCat(command[0], " failed: ", why.empty() ? "it does not say why" : why));
}

}  // namespace calib::ctl
