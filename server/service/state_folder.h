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
  /// Creates the folder if need be, for its account alone; so is every file in it. Errors:
  /// ALREADY_EXISTS when another process serves it; the message names its process and address.
  /// PERMISSION_DENIED when it is another account's. RESOURCE_EXHAUSTED when it cannot be written.
  static absl::StatusOr<std::unique_ptr<StateFolder>> Open(const std::string& directory);
  /// Removes server.json and gives the lock back.
  ~StateFolder();
  StateFolder(const StateFolder&) = delete;
  StateFolder& operator=(const StateFolder&) = delete;

  std::string DatabasePath() const { return directory_ + "/calib.db"; }
  /// The token of this folder's server, 64 hexadecimal digits, made at the first call and kept in
  /// DIR/token.
  absl::StatusOr<std::string> Token() const;
  /// Leaves the token where programs of this account look for the server at `port`
  /// (rpc::TokenFolders); taken away by the destructor, unless another server has left its own
  /// there. Where there is no such place it is to be named (--token DIR/token), and this says so.
  absl::Status LeaveToken(const std::string& token, int port);
  /// unix:/PATH of a socket in a folder that only this account enters: DIR/run, or where that is
  /// too long a path for a socket, one in $XDG_RUNTIME_DIR/calib or /tmp/calib-UID.
  /// PERMISSION_DENIED: such a folder is there and is not this account's alone.
  absl::StatusOr<std::string> SocketAddress() const;
  /// Writes server.json: {"address": "127.0.0.1:43210", "pid": 123, "stays": false}. stays: see
  /// ServerOptions.
  absl::Status Announce(const std::string& address, bool stays = false) const;

 private:
  StateFolder(std::string directory, int lock) : directory_(std::move(directory)), lock_(lock) {}
  std::string directory_;
  int lock_;
  std::string left_token_{};  // path; empty: none
  std::string token_{};       // that was left there
};

/// Address of the process that serves the folder now. NOT_FOUND: none does (no server.json, or its
/// lock is free); PERMISSION_DENIED: the folder is another account's; UNAVAILABLE: one holds the
/// lock but has not announced its address yet (retry).
absl::StatusOr<std::string> ServingAddress(const std::string& directory);

/// True where a process serves the folder that stays, as far as has been announced.
bool IsServedForGood(const std::string& directory);

}  // namespace calib::service
