#pragma once
// A server process and its workers, as a user would run them.

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/client.h"
#include "tests/support/process.h"

namespace calib::testing {

struct DeploymentOptions {
  std::string name = "deployment";
  int lease_ms = 3000;
  int heartbeat_ms = 100;
  std::vector<std::string> server_options{};  ///< further ones of calibd
  /// NAME=VALUE, of the server's environment.
  std::vector<std::string> server_environment{};
  int open_files = 0;  ///< that the server may have; 0: as many as the test
};

/// Everything in one fresh folder: state, logs. Children are killed with it.
class Deployment {
 public:
  explicit Deployment(DeploymentOptions options);

  /// Starts calibd on a free port, or after the first time on the same port; returns once it
  /// answers.
  bool StartServer();
  /// options: further ones of calib-worker.
  void StartWorker(int slots = 1, const std::vector<std::string>& options = {});
  /// Workers that are started from now on are told this address, with the token of this server.
  void SetAddressForWorkers(std::string address) { address_for_workers_ = std::move(address); }

  Process& server() { return *server_; }
  std::vector<Process>& workers() { return workers_; }
  Client client() const { return Client(address_); }
  const std::string& address() const { return address_; }
  std::string state() const { return folder_ + "/state"; }
  const std::string& folder() const { return folder_; }
  /// What the processes have logged, for a failing test.
  std::string Logs() const;

 private:
  const DeploymentOptions options_;
  const std::string folder_;
  std::string address_ = "127.0.0.1:0";
  std::string address_for_workers_{};  // empty: that of the server
  int started_workers_ = 0;
  std::unique_ptr<Process> server_;
  std::vector<Process> workers_;
};

/// Everything a user would call the result: posterior, weights and states with all their bits,
/// times and effort left out. Equal texts mean bit-identical results.
absl::StatusOr<std::string> Fingerprint(Client& client, const std::string& campaign);

}  // namespace calib::testing
