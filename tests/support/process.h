#pragma once
// Child processes of a test: started, signalled and awaited by their own id.

#include <sys/types.h>

#include <chrono>
#include <string>
#include <vector>

namespace calib::testing {

/// Kills the child if it still runs when this goes.
class Process {
 public:
  /// Starts argv[0]; standard error is appended to `log`.
  Process(const std::vector<std::string>& argv, const std::string& log);
  ~Process();
  Process(Process&& other) noexcept;
  Process& operator=(Process&& other) noexcept;

  pid_t id() const { return id_; }
  void Signal(int signal) const;
  /// kill -9, and waits until it is gone.
  void Kill();
  /// Exit status, or -signal if a signal ended it; -1000 when it still runs after `limit`.
  int Wait(std::chrono::milliseconds limit);
  bool Running();

 private:
  pid_t id_ = 0;
  int status_ = 0;
};

/// Calls `condition` until it is true; false after `limit`.
template <typename Condition>
bool Eventually(std::chrono::milliseconds limit, Condition condition);

/// Path of a program of this build.
std::string Program(const std::string& name);

/// A fresh, empty folder for this test.
std::string FreshFolder(const std::string& name);

}  // namespace calib::testing

#include <thread>

template <typename Condition>
bool calib::testing::Eventually(std::chrono::milliseconds limit, Condition condition) {
  const auto end = std::chrono::steady_clock::now() + limit;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) {
      return false;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}
