#include "worker/program/launcher.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <future>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"

extern char** environ;  // NOLINT(readability-redundant-declaration): POSIX has it nowhere

namespace calib::worker {
namespace {

struct PipeEnds {
  int read = -1;
  int write = -1;
  ~PipeEnds() {
    if (read >= 0) close(read);
    if (write >= 0) close(write);
  }
};

/// Ends from 3 on: those below are taken by dup2 in the child.
absl::Status MakePipe(PipeEnds& pipe) {
  std::array<int, 2> made{};
  if (pipe2(made.data(), O_CLOEXEC) != 0) {
    return absl::UnavailableError(absl::StrCat("no pipe: ", std::strerror(errno)));
  }
  for (int& end : made) {
    if (end > STDERR_FILENO) continue;
    const int moved = fcntl(end, F_DUPFD_CLOEXEC, STDERR_FILENO + 1);
    close(end);
    end = moved;
  }
  pipe.read = made[0];
  pipe.write = made[1];
  return pipe.read >= 0 && pipe.write >= 0 ? absl::OkStatus()
                                           : absl::UnavailableError("no file descriptor is left");
}

void SetNonBlocking(int file) { fcntl(file, F_SETFL, fcntl(file, F_GETFL) | O_NONBLOCK); }

/// Everything that the child needs between fork and exec, where nothing may be allocated.
struct Prepared {
  std::vector<char*> arguments;
  std::vector<std::string> variables;
  std::vector<char*> environment;
  int input = -1;
  int output = -1;
  int error = -1;
  int report = -1;
  pid_t parent = -1;
  std::optional<rlim_t> most_file_bytes;
};

/// Where the preparation of the child failed: the working directory may be gone.
constexpr int kNoFolder = -1;

/// In the child: only functions that are safe in the handler of a signal [POSIX.1-2017, 2.4.3].
[[noreturn]] void BecomeProgram(const ChildOptions& options, const Prepared& prepared) {
  const auto give_up = [&](int reason) {
    [[maybe_unused]] const ssize_t written = write(prepared.report, &reason, sizeof(reason));
    _exit(127);
  };
  setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != prepared.parent) _exit(127);  // it had died before it could be watched
  const rlimit none{.rlim_cur = 0, .rlim_max = 0};
  setrlimit(RLIMIT_CORE, &none);
  if (prepared.most_file_bytes.has_value()) {
    rlimit files{};
    getrlimit(RLIMIT_FSIZE, &files);
    files.rlim_cur = std::min(files.rlim_max, *prepared.most_file_bytes);
    files.rlim_max = files.rlim_cur;
    setrlimit(RLIMIT_FSIZE, &files);
  }
  if (dup2(prepared.input, STDIN_FILENO) < 0 || dup2(prepared.output, STDOUT_FILENO) < 0 ||
      dup2(prepared.error, STDERR_FILENO) < 0) {
    give_up(errno);
  }
  if (chdir(options.folder.c_str()) != 0) give_up(kNoFolder);
    // Files of the worker's libraries that were opened without CLOEXEC; an older kernel keeps them.
#ifdef SYS_close_range
  constexpr unsigned kSetCloexec = 1U << 2U;
  syscall(SYS_close_range, STDERR_FILENO + 1U, ~0U, kSetCloexec);
#endif
  // What the worker ignores, a program would ignore as well.
  for (int number = 1; number < NSIG; ++number) signal(number, SIG_DFL);
  sigset_t no_signal;
  sigemptyset(&no_signal);
  sigprocmask(SIG_SETMASK, &no_signal, nullptr);
  execve(options.program.c_str(), prepared.arguments.data(), prepared.environment.data());
  give_up(errno);
  _exit(127);
}

std::string NameOf(const std::string& variable) { return variable.substr(0, variable.find('=')); }

void PrepareEnvironment(const ChildOptions& options, Prepared& prepared) {
  for (char** variable = environ; variable != nullptr && *variable != nullptr; ++variable) {
    const std::string name = NameOf(*variable);
    const auto& own = options.environment;
    if (std::none_of(own.begin(), own.end(),
                     [&](const std::string& other) { return NameOf(other) == name; })) {
      prepared.variables.emplace_back(*variable);
    }
  }
  for (const std::string& own : options.environment) {
    // A name alone takes the variable away.
    if (own.find('=') != std::string::npos) prepared.variables.push_back(own);
  }
  for (std::string& variable : prepared.variables) prepared.environment.push_back(variable.data());
  prepared.environment.push_back(nullptr);
}

absl::Status WhyNotRun(const ChildOptions& options, int reason) {
  const std::string& name = options.arguments.front();
  switch (reason) {
    case ENOENT:
      return absl::FailedPreconditionError(
          access(options.program.c_str(), F_OK) == 0
              ? absl::StrCat(name, ": the interpreter of its first line is not on this node")
              : absl::StrCat(name, ": not found on this node"));
    case EACCES:
    case EPERM:
      return absl::FailedPreconditionError(absl::StrCat(name, ": may not be executed"));
    case ENOEXEC:
      return absl::FailedPreconditionError(absl::StrCat(
          name, ": neither a program of this machine nor a script that begins with #!"));
    case E2BIG:
      return absl::FailedPreconditionError(absl::StrCat(name, ": its arguments are too long"));
    case ETXTBSY:
      return absl::AbortedError(absl::StrCat(name, ": is being written"));
    case kNoFolder:
      return absl::UnavailableError(absl::StrCat(options.folder, ": cannot be entered"));
    case ENOMEM:
    case EAGAIN:
    case EMFILE:
    case ENFILE:
    case EIO:
      return absl::UnavailableError(absl::StrCat(name, ": ", std::strerror(reason)));
    default:
      return absl::FailedPreconditionError(absl::StrCat(name, ": ", std::strerror(reason)));
  }
}

}  // namespace

Launcher::Launcher() : thread_([this](const std::stop_token& stop) { Serve(stop); }) {}

Launcher::~Launcher() = default;

void Launcher::Serve(const std::stop_token& stop) {
  // No handler of the worker may run in a child before it has become the program.
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, nullptr);
  std::unique_lock lock(mutex_);
  while (changed_.wait(lock, stop, [this] { return !orders_.empty(); })) {
    const auto order = std::move(orders_.front());
    orders_.pop_front();
    lock.unlock();
    order();
    lock.lock();
  }
}

absl::StatusOr<std::unique_ptr<ChildProcess>> Launcher::Start(const ChildOptions& options) {
  // A program that was copied just now is open for writing in a child of another slot, until that
  // child has become its program.
  constexpr int kMostTries = 100;
  constexpr std::chrono::milliseconds kPause{10};
  for (int tries = 1;; ++tries) {
    auto child = StartOnce(options);
    if (child.ok() || child.status().code() != absl::StatusCode::kAborted) return child;
    if (tries == kMostTries) return absl::UnavailableError(child.status().message());
    std::this_thread::sleep_for(kPause);
  }
}

absl::StatusOr<std::unique_ptr<ChildProcess>> Launcher::StartOnce(const ChildOptions& options) {
  PipeEnds input;
  PipeEnds output;
  PipeEnds error;
  PipeEnds report;
  for (PipeEnds* pipe : {&input, &output, &error, &report}) RETURN_IF_ERROR(MakePipe(*pipe));
  std::vector<std::string> arguments = options.arguments;
  Prepared prepared{.arguments = {},
                    .variables = {},
                    .environment = {},
                    .input = input.read,
                    .output = output.write,
                    .error = error.write,
                    .report = report.write,
                    .parent = getpid(),
                    .most_file_bytes = {}};
  for (std::string& argument : arguments) prepared.arguments.push_back(argument.data());
  prepared.arguments.push_back(nullptr);
  PrepareEnvironment(options, prepared);
  constexpr double kMostFileBytes = 9e18;
  if (options.most_file_bytes.has_value() && *options.most_file_bytes < kMostFileBytes) {
    prepared.most_file_bytes = static_cast<rlim_t>(*options.most_file_bytes);
  }
  std::promise<pid_t> made;
  int fork_error = 0;
  {
    const std::lock_guard lock(mutex_);
    orders_.emplace_back([&] {
      const pid_t pid = fork();
      if (pid == 0) BecomeProgram(options, prepared);
      fork_error = errno;
      made.set_value(pid);
    });
  }
  changed_.notify_one();
  const pid_t pid = made.get_future().get();
  if (pid < 0) {
    return absl::UnavailableError(absl::StrCat("no process: ", std::strerror(fork_error)));
  }
  setpgid(pid, pid);  // whoever of the two comes first
  std::unique_ptr<ChildProcess> child(new ChildProcess());
  child->pid_ = pid;
  child->input_ = std::exchange(input.write, -1);
  child->output_ = std::exchange(output.read, -1);
  child->error_ = std::exchange(error.read, -1);
  for (const int file : {child->input_, child->output_, child->error_}) SetNonBlocking(file);
  // The child alone has the other ends, so that their ends are told.
  for (int* file : {&input.read, &output.write, &error.write, &report.write}) CloseFile(*file);
  int reason = 0;
  ssize_t got = 0;
  while ((got = read(report.read, &reason, sizeof(reason))) < 0 && errno == EINTR) {
  }
  if (got == sizeof(reason)) return WhyNotRun(options, reason);
#ifdef SYS_pidfd_open
  child->handle_ = static_cast<int>(syscall(SYS_pidfd_open, pid, 0));  // closes on exec
#endif
  return child;
}

}  // namespace calib::worker
