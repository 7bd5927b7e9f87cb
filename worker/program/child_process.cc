#include "worker/program/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "proto/rpc/text_kinds.h"

namespace calib::worker {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kPiece = std::size_t{64} << 10;
constexpr std::size_t kMostOfATurn = std::size_t{4} << 20;  // bytes, before limits are looked at
constexpr std::chrono::milliseconds kLastWords{200};        // for what the killed still hold open

/// SIGPIPE, which a write raises whose reader has gone, is for this thread to forget, whatever the
/// program does with it elsewhere.
class PipeSignalHeld {
 public:
  PipeSignalHeld() {
    sigemptyset(&pipe_);
    sigaddset(&pipe_, SIGPIPE);
    sigset_t pending;
    sigpending(&pending);
    was_pending_ = sigismember(&pending, SIGPIPE) == 1;
    pthread_sigmask(SIG_BLOCK, &pipe_, &before_);
  }
  ~PipeSignalHeld() {
    const timespec at_once{};
    while (!was_pending_ && sigtimedwait(&pipe_, nullptr, &at_once) > 0) {
    }
    pthread_sigmask(SIG_SETMASK, &before_, nullptr);
  }
  PipeSignalHeld(const PipeSignalHeld&) = delete;
  PipeSignalHeld& operator=(const PipeSignalHeld&) = delete;

 private:
  sigset_t pipe_{};
  sigset_t before_{};
  bool was_pending_ = false;
};

}  // namespace

std::string InWords(const ChildEnd& end) {
  if (!end.signal.has_value()) return absl::StrCat("exit ", end.exit.value_or(0));
  const char* const name = sigabbrev_np(*end.signal);
  return name != nullptr ? absl::StrCat("SIG", name) : absl::StrCat("signal ", *end.signal);
}

void CloseFile(int& file) {
  if (file >= 0) close(file);
  file = -1;
}

ChildProcess::~ChildProcess() {
  if (!end_.has_value() && pid_ > 0) {
    KillAll();
    Reap([](std::string_view) {});
  }
  CloseFile(input_);
  CloseFile(output_);
  CloseFile(error_);
  CloseFile(handle_);
}

void ChildProcess::Send(std::string_view bytes) {
  if (input_ >= 0) to_write_.append(bytes);
}

void ChildProcess::WriteInput() {
  while (input_ >= 0 && !to_write_.empty()) {
    const PipeSignalHeld held;
    const ssize_t written = write(input_, to_write_.data(), to_write_.size());
    if (written > 0) {
      to_write_.erase(0, static_cast<std::size_t>(written));
    } else if (written < 0 && errno == EINTR) {
      continue;
    } else if (written < 0 && errno == EAGAIN) {
      return;
    } else {
      CloseFile(input_);  // the program does not want to hear it
      to_write_.clear();
    }
  }
  if (close_input_ && to_write_.empty()) CloseFile(input_);
}

void ChildProcess::ReadOutput(const Sink& output, std::size_t most) {
  std::array<char, kPiece> piece;
  for (std::size_t read_so_far = 0; output_ >= 0 && read_so_far < most;) {
    const ssize_t got = read(output_, piece.data(), piece.size());
    if (got > 0) {
      read_so_far += static_cast<std::size_t>(got);
      output({piece.data(), static_cast<std::size_t>(got)});
    } else if (got < 0 && errno == EINTR) {
      continue;
    } else if (got < 0 && errno == EAGAIN) {
      return;
    } else {
      CloseFile(output_);
    }
  }
}

void ChildProcess::ReadWords() {
  std::array<char, kPiece> piece;
  for (std::size_t read_so_far = 0; error_ >= 0 && read_so_far < kMostOfATurn;) {
    const ssize_t got = read(error_, piece.data(), piece.size());
    if (got > 0) {
      read_so_far += static_cast<std::size_t>(got);
      words_.append(piece.data(), static_cast<std::size_t>(got));
      if (words_.size() > kMostWords) words_.erase(0, words_.size() - kMostWords);
    } else if (got < 0 && errno == EINTR) {
      continue;
    } else if (got < 0 && errno == EAGAIN) {
      return;
    } else {
      CloseFile(error_);
    }
  }
}

void ChildProcess::Turn(std::chrono::milliseconds longest, const Sink& output) {
  if (end_.has_value()) return;
  WriteInput();
  constexpr std::chrono::milliseconds kWithoutHandle{10};
  if (handle_ < 0) longest = std::min(longest, kWithoutHandle);
  // poll passes over negative descriptors.
  std::array<pollfd, 4> watched{
      {{.fd = output_, .events = POLLIN, .revents = 0},
       {.fd = error_, .events = POLLIN, .revents = 0},
       {.fd = to_write_.empty() ? -1 : input_, .events = POLLOUT, .revents = 0},
       {.fd = handle_, .events = POLLIN, .revents = 0}}};
  poll(watched.data(), watched.size(), static_cast<int>(longest.count()));
  ReadOutput(output, kMostOfATurn);
  ReadWords();
  WriteInput();
  if (HasEnded()) Reap(output);
}

bool ChildProcess::HasEnded() const {
  // It stays a zombie for now: until it is waited for its id, and with it the group's, is its own.
  siginfo_t info{};
  return waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 &&
         info.si_pid == pid_;
}

void ChildProcess::KillAll() {
  // Descendants may have left the group, as the ranks of an MPI run do.
  Look();
  kill(-pid_, SIGKILL);
  for (const ProcessId& member : members_) KillIfThere(member);
}

void ChildProcess::Reap(const Sink& output) {
  siginfo_t info{};
  while (waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOWAIT) != 0 && errno == EINTR) {
  }
  ReadOutput(output, kMostOfATurn);
  KillAll();
  // The killed close their ends as they go; one that got away may hold an end for ever.
  for (const auto until = Clock::now() + kLastWords;
       (output_ >= 0 || error_ >= 0) && Clock::now() < until;) {
    std::array<pollfd, 2> ends{{{.fd = output_, .events = POLLIN, .revents = 0},
                                {.fd = error_, .events = POLLIN, .revents = 0}}};
    poll(ends.data(), ends.size(), 10);
    ReadOutput(output, kMostOfATurn);
    ReadWords();
  }
  int status = 0;
  rusage use{};
  while (wait4(pid_, &status, 0, &use) < 0 && errno == EINTR) {
  }
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  cpu_seconds_ = std::max(cpu_seconds_, seconds(use.ru_utime) + seconds(use.ru_stime));
  end_ = WIFSIGNALED(status) ? ChildEnd{.exit = {}, .signal = WTERMSIG(status)}
                             : ChildEnd{.exit = WEXITSTATUS(status), .signal = {}};
}

void ChildProcess::End(std::chrono::milliseconds grace, const Sink& output) {
  if (end_.has_value()) return;
  Look();
  kill(-pid_, SIGTERM);
  for (const auto until = Clock::now() + grace; !end_.has_value() && Clock::now() < until;) {
    constexpr std::chrono::milliseconds kStep{20};
    Turn(kStep, output);
  }
  if (!end_.has_value()) {
    KillAll();
    Reap(output);
  }
}

TreeUse ChildProcess::Look() {
  if (end_.has_value()) return {};
  TreeUse use = LookAtTree(pid_);
  cpu_seconds_ = std::max(cpu_seconds_, use.cpu_seconds);
  // Who is nobody's child by now is still to be killed at the end.
  std::vector<ProcessId> members = use.members;
  for (const ProcessId& member : members_) {
    if (std::find(members.begin(), members.end(), member) == members.end() && IsThere(member)) {
      members.push_back(member);
    }
  }
  members_ = std::move(members);
  return use;
}

std::string ChildProcess::words() const {
  std::string text = words_;
  // The cut may have gone through a character.
  while (words_.size() == kMostWords && !text.empty() &&
         (static_cast<unsigned char>(text.front()) & 0xc0U) == 0x80U) {
    text.erase(0, 1);
  }
  for (char& c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if ((byte < 0x20 && c != '\n' && c != '\t') || byte == 0x7f) c = c == '\r' ? ' ' : '?';
  }
  return rpc::Fitted(v1::REASON, text);
}

}  // namespace calib::worker
