#pragma once
// Threads that ask the server the questions of the page, each over a connection of its own.

#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "absl/status/statusor.h"
#include "server/client/client.h"

namespace calib::page {

/// Makes a client of the server; called on any thread.
using Connect = std::function<absl::StatusOr<std::unique_ptr<client::Client>>()>;

/// Ask() may be called on any thread.
class Askers {
 public:
  /// Returns UNAVAILABLE where the server was lost: the next work gets another client.
  using Work = std::function<absl::Status(const absl::StatusOr<client::Client*>&)>;

  /// niceness: of nice(1), for its threads.
  Askers(Connect connect, int threads, int niceness);
  ~Askers();  ///< work that has not begun is not done
  Askers(const Askers&) = delete;
  Askers& operator=(const Askers&) = delete;

  /// Does `work` on one of the threads, with a client or with why there is none. False: as much
  /// waits as is taken, and nothing is done.
  bool Ask(Work work);

 private:
  void Run(const std::stop_token& stop);

  const Connect connect_;
  const int niceness_;
  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<Work> waiting_;
  std::vector<std::jthread> threads_;
};

}  // namespace calib::page
