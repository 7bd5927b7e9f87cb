#pragma once
// The folder that holds a server's state, owned by one process at a time.

#include <memory>
#include <string>

#include "absl/status/statusor.h"

namespace calib::service {

/// Not thread-safe. Holds DIR/lock (an open file description lock) while it lives and says in
/// DIR/server.json who serves the folder.
class StateFolder {
 public:
  /// Creates the folder if need be. Errors: ALREADY_EXISTS when another process serves it; the
  /// message names its process and address. RESOURCE_EXHAUSTED when it cannot be written.
  static absl::StatusOr<std::unique_ptr<StateFolder>> Open(const std::string& directory);
  /// Removes server.json and gives the lock back.
  ~StateFolder();
  StateFolder(const StateFolder&) = delete;
  StateFolder& operator=(const StateFolder&) = delete;

  std::string DatabasePath() const { return directory_ + "/calib.db"; }
  /// Writes server.json: {"address": "127.0.0.1:43210", "pid": 123, "stays": false}. stays: see
  /// ServerOptions.
  absl::Status Announce(const std::string& address, bool stays = false) const;

 private:
  StateFolder(std::string directory, int lock) : directory_(std::move(directory)), lock_(lock) {}
  std::string directory_;
  int lock_;
};

/// Address of the process that serves the folder now. NOT_FOUND: none does (no server.json, or its
/// lock is free); UNAVAILABLE: one holds the lock but has not announced its address yet (retry).
absl::StatusOr<std::string> ServingAddress(const std::string& directory);

/// True where a process serves the folder that stays, as far as has been announced.
bool IsServedForGood(const std::string& directory);

}  // namespace calib::service
