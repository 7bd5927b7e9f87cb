// calibd: the service.
#include <sys/prctl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <csignal>
#include <cstdlib>
#include <iostream>
#include <memory>

#include "proto/rpc/access.h"
#include "proto/rpc/address.h"
#include "proto/rpc/service_manager.h"
#include "server/page/page.h"
#include "server/service/server.h"

namespace {

constexpr std::chrono::seconds kShutdown{5};
constexpr const char* kOwnSocket = "unix:";

/// Options for how much the server takes.
void AddLimits(CLI::App& app, calib::service::Limits& limits) {
  const auto add = [&app](const char* name, auto& limit, const char* help) {
    app.add_option(name, limit, help)
        ->check(CLI::Range(1, 1'000'000'000))
        ->capture_default_str()
        ->group("How much the server takes");
  };
  add("--max-connections", limits.connections, "connections, fewer where the system allows fewer");
  add("--max-streams-per-peer", limits.streams_per_peer, "calls that one connection has open");
  add("--max-blobs-per-peer", limits.blobs_per_peer, "files on their way over one connection");
  add("--max-blobs", limits.blobs, "files on their way, of all");
  add("--max-blob-mib", limits.blob_mib, "of one file");
  add("--max-slots", limits.slots, "slots of one worker");
  add("--max-campaigns", limits.campaigns, "campaigns that are not over");
  add("--max-campaign-mib", limits.campaign_mib, "of the files of one campaign");
  add("--max-samples", limits.samples, "samples of one iteration");
  add("--max-readings", limits.readings, "readings of one campaign");
  add("--max-predictions", limits.predictions, "samples times readings");
  add("--max-covariance", limits.covariance, "readings of one covariance matrix");
  add("--max-packings", limits.packings, "packings of one campaign");
  add("--max-grains", limits.grains, "grains in the packing files of one campaign");
}

/// The live page over a server that serves. A page that cannot be is warned of: what is computed
/// does not depend on it.
std::unique_ptr<calib::page::Page> ServePage(const std::string& http,
                                             const calib::service::ServerOptions& options,
                                             calib::service::Server& server) {
  const auto token = calib::rpc::ReadToken(options.state_dir + "/token");
  auto page =
      token.ok()
          ? calib::page::Page::Start(
                {.listen = http,
                 .tls = options.tls,
                 .insecure = options.insecure,
                 .token = *token,
                 .connect =
                     [&server] { return calib::client::Client::Over(server.InProcessChannel()); }})
          : absl::StatusOr<std::unique_ptr<calib::page::Page>>(token.status());
  if (!page.ok()) {
    std::cerr << "calibd: no page: " << page.status().message() << '\n';
    return nullptr;
  }
  std::cerr << "page: " << (*page)->address() << '\n';
  return *std::move(page);
}

}  // namespace

int main(int argc, char** argv) {
  setenv("GRPC_VERBOSITY", "NONE", 0);  // what goes wrong is said below, in a sentence
  CLI::App app{
      "Holds calibration campaigns and leases their model evaluations to calib-worker nodes."};
  calib::service::ServerOptions options;
  options.listen = "127.0.0.1:7443";
  int parent = -1;
  std::int64_t lease_ms = options.lease.count();
  std::int64_t heartbeat_ms = options.heartbeat.count();
  app.add_option("--state", options.state_dir, "folder of the state, created if need be")
      ->required();
  app.add_option("--listen", options.listen,
                 "HOST:PORT, port 0 for a free one (DIR/server.json tells which), unix:/PATH, or "
                 "unix: for a socket that this account alone reaches")
      ->check([](const std::string& address) {
        return address == kOwnSocket ? "" : calib::rpc::ProblemOfAddress(address, 0);
      })
      ->capture_default_str();
  app.add_option(
         "--tls", options.tls,
         "folder of the server's certificate, from `calibctl certs issue`; callers show one "
         "too [none: plain text, and the token that is written to DIR/token]")
      ->envname("CALIB_TLS");
  app.add_flag("--insecure", options.insecure,
               "listen in plain text where other machines reach it");
  std::string http;
  app.add_option("--http", http,
                 "HOST:PORT of the live page and its documents, port 0 for a free one [none]")
      ->check([](const std::string& address) {
        return calib::rpc::SocketPathOf(address).empty() ? calib::rpc::ProblemOfAddress(address, 0)
                                                         : "a page is served over HOST:PORT";
      });
  app.add_option("--lease-ms", lease_ms,
                 "an evaluation is handed to another worker after this silence")
      ->check(CLI::Range(50, 86'400'000))
      ->capture_default_str();
  app.add_option("--heartbeat-ms", heartbeat_ms, "workers speak at least this often")
      ->check(CLI::Range(10, 3'600'000))
      ->capture_default_str();
  AddLimits(app, options.limits);
  app.add_option("--log", options.log_file, "log file [standard error]");
  app.add_option(
         "--exit-with-parent", parent,
         "end when the parent process, of this id, ends; who shares the folder then goes on "
         "without it")
      ->check(CLI::PositiveNumber);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  if (heartbeat_ms >= lease_ms) {
    std::cerr << "--heartbeat-ms must be below --lease-ms\n";
    return 2;
  }
  options.stays = parent < 0;
  if (options.listen == kOwnSocket) options.listen.clear();
  options.lease = std::chrono::milliseconds(lease_ms);
  options.heartbeat = std::chrono::milliseconds(heartbeat_ms);

  // Blocked before any thread exists, so that all of them leave the signals to sigwait below.
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);

  if (parent >= 0) {
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (getppid() != parent) return 0;  // it has ended already
  }
  std::atomic<bool> failed = false;
  options.on_failure = [&failed](const absl::Status&) {
    failed = true;
    kill(getpid(), SIGTERM);
  };
  auto server = calib::service::Server::Start(options);
  if (!server.ok()) {
    std::cerr << "calibd: " << server.status().message() << '\n';
    return absl::IsInvalidArgument(server.status()) ? 2 : 1;
  }
  auto page = http.empty() ? nullptr : ServePage(http, options, **server);
  calib::rpc::TellServiceManager(calib::rpc::kReady);
  int signal = 0;
  sigwait(&signals, &signal);
  calib::rpc::TellServiceManager(calib::rpc::kStopping);
  page.reset();
  (*server)->Shutdown(kShutdown);
  return failed ? 1 : 0;
}
