// calibd: the service.
#include <spdlog/spdlog.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <condition_variable>
#include <csignal>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <mutex>
#include <thread>

#include "proto/rpc/access.h"
#include "proto/rpc/address.h"
#include "proto/rpc/service_manager.h"
#include "proto/rpc/set_up_process.h"
#include "server/page/page.h"
#include "server/restore.h"
#include "server/service/server.h"

namespace {

constexpr std::chrono::seconds kShutdown{5};
constexpr std::chrono::seconds kLongestEnd{9};
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

/// Options for the log.
void AddLog(CLI::App& app, calib::service::ServerOptions& options) {
  const auto group = [](CLI::Option* option) { option->group("What it logs"); };
  group(app.add_option("--log-file,--log", options.log_file, "FILE of the log [standard error]"));
  group(app.add_option_function<std::string>(
               "--log-format",
               [&options](const std::string& form) { options.log.json = form == "json"; },
               "text, or json: one object a line [text]")
            ->check([](const std::string& form) {
              return form == "text" || form == "json" ? "" : "lines of a log are text or json";
            }));
  group(
      app.add_option("--log-mib", options.log.file_mib,
                     "FILE is begun anew before it is larger; those before stay as FILE.1, FILE.2, "
                     "the number before its ending; 0: never")
          ->check(CLI::Range(0, 1'000'000))
          ->capture_default_str());
  group(app.add_option("--log-files", options.log.files, "of these that stay")
            ->check(CLI::Range(1, 1000))
            ->capture_default_str());
}

/// Ends the process where an orderly end takes longer than whoever stops it waits: a computation
/// that cannot be left, a peer that neither reads nor goes. Nothing that was acknowledged is lost.
class LastResort {
 public:
  LastResort()
      : thread_([](const std::stop_token& stop) {
          std::mutex mutex;
          std::unique_lock lock(mutex);
          std::condition_variable_any never;
          if (never.wait_for(lock, stop, kLongestEnd, [] { return false; }) ||
              stop.stop_requested()) {
            return;
          }
          spdlog::warn("ended_at_once reason=\"an orderly end has taken {} s\"",
                       kLongestEnd.count());
          spdlog::shutdown();
          _exit(0);
        }) {}

 private:
  std::jthread thread_;
};

/// Makes a state folder of a backup; the exit code.
int Restore(const std::string& backup, const std::string& state) {
  const auto campaigns = calib::Restore(backup, state);
  if (!campaigns.ok()) {
    std::cerr << "calibd: " << campaigns.status().message() << '\n';
    return 1;
  }
  std::cerr << state << " holds what " << backup << " was taken of: " << *campaigns
            << (*campaigns == 1 ? " campaign\n" : " campaigns\n");
  return 0;
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
  calib::rpc::SetUpProcess();
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
  AddLog(app, options);
  std::string backup;
  app.add_option("--restore", backup,
                 "FILE of `calibctl backup`: makes the state folder of it, which must be new or "
                 "empty, and ends; with --listen or --http it serves then");
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
  if (!backup.empty()) {
    const int restored = Restore(backup, options.state_dir);
    const bool serves = app.count("--listen") > 0 || app.count("--http") > 0;
    if (restored != 0 || !serves) return restored;
  }
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
  const LastResort last_resort;
  page.reset();
  (*server)->Shutdown(kShutdown);
  return failed ? 1 : 0;
}
