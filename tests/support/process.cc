#include "tests/support/process.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <utility>

namespace calib::testing {

Process::Process(const std::vector<std::string>& argv, const std::string& log) {
  std::vector<char*> arguments;
  for (const std::string& argument : argv) {
    arguments.push_back(const_cast<char*>(argument.c_str()));
  }
  arguments.push_back(nullptr);
  id_ = fork();
  if (id_ == 0) {
    // Only async-signal-safe calls between fork and exec: the test has threads.
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    const int file = open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0644);
    dup2(file, STDERR_FILENO);
    sigset_t none;
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, nullptr);
    execv(arguments.front(), arguments.data());
    _exit(127);
  }
}

Process::~Process() {
  if (id_ > 0) {
    Kill();
  }
}

Process::Process(Process&& other) noexcept
    : id_(std::exchange(other.id_, 0)), status_(other.status_) {}

Process& Process::operator=(Process&& other) noexcept {
  std::swap(id_, other.id_);
  std::swap(status_, other.status_);
  return *this;
}

void Process::Signal(int signal) const {
  if (id_ > 0) {
    kill(id_, signal);
  }
}

void Process::Kill() {
  Signal(SIGKILL);
  if (id_ > 0) {
    waitpid(id_, &status_, 0);
    id_ = 0;
  }
}

bool Process::Running() {
  if (id_ > 0 && waitpid(id_, &status_, WNOHANG) == id_) {
    id_ = 0;
  }
  return id_ > 0;
}

int Process::Wait(std::chrono::milliseconds limit) {
  if (!Eventually(limit, [this] { return !Running(); })) {
    return -1000;
  }
  return WIFSIGNALED(status_) ? -WTERMSIG(status_) : WEXITSTATUS(status_);
}

std::string Program(const std::string& name) { return std::string(CALIB_BIN) + "/" + name; }

std::string FreshFolder(const std::string& name) {
  const auto path =
      std::filesystem::temp_directory_path() / ("calib-" + name + "-" + std::to_string(getpid()));
  std::filesystem::remove_all(path);
  std::filesystem::create_directories(path);
  return path.string();
}

}  // namespace calib::testing
