#include "tests/support/deployment.h"

#include <filesystem>
#include <fstream>
#include <sstream>

#include "proto/rpc/digest.h"
#include "server/service/state_folder.h"

namespace calib::testing {
namespace {

constexpr std::chrono::seconds kStart{20};

}  // namespace

Deployment::Deployment(DeploymentOptions options)
    : options_(std::move(options)), folder_(FreshFolder(options_.name)) {}

bool Deployment::StartServer() {
  std::vector<std::string> command{Program("calibd"),
                                   "--state",
                                   state(),
                                   "--listen",
                                   address_,
                                   "--lease-ms",
                                   std::to_string(options_.lease_ms),
                                   "--heartbeat-ms",
                                   std::to_string(options_.heartbeat_ms)};
  command.insert(command.end(), options_.server_options.begin(), options_.server_options.end());
  if (!options_.server_environment.empty()) {
    command.insert(command.begin(), options_.server_environment.begin(),
                   options_.server_environment.end());
    command.insert(command.begin(), "/usr/bin/env");
  }
  if (options_.open_files > 0) {
    command.insert(command.begin(),
                   {"/bin/sh", "-c",
                    "ulimit -n " + std::to_string(options_.open_files) + " && exec \"$0\" \"$@\""});
  }
  server_ = std::make_unique<Process>(command, folder_ + "/server.log");
  return Eventually(kStart, [this] {
    const auto address = service::ServingAddress(state());
    if (!address.ok() || !server_->Running()) {
      return false;
    }
    address_ = *address;
    return client().List().ok();
  });
}

void Deployment::StartWorker(int slots, const std::vector<std::string>& options) {
  const std::string name = "w" + std::to_string(++started_workers_);
  std::vector<std::string> command{
      Program("calib-worker"),         "--server", address_, "--slots",
      std::to_string(slots),           "--name",   name,     "--checkpoints",
      folder_ + "/checkpoints-" + name};
  if (!address_for_workers_.empty()) {
    command[2] = address_for_workers_;
    command.insert(command.end(), {"--token", state() + "/token"});
  }
  command.insert(command.end(), options.begin(), options.end());
  workers_.emplace_back(command, folder_ + "/" + name + ".log");
}

std::string Deployment::Logs() const {
  std::ostringstream text;
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
    if (entry.path().extension() == ".log") {
      text << "==== " << entry.path().filename().string() << '\n'
           << std::ifstream(entry.path()).rdbuf() << '\n';
    }
  }
  return text.str();
}

absl::StatusOr<std::string> Fingerprint(Client& client, const std::string& campaign) {
  auto posterior = client.Posterior(campaign);
  auto samples = client.Samples(campaign);
  auto states = client.States(campaign);
  for (const absl::Status& status : {posterior.status(), samples.status(), states.status()}) {
    if (!status.ok()) {
      return status;
    }
  }
  posterior->clear_core_hours();
  posterior->clear_model_evaluations();  // what another campaign has run first is not run again
  std::string bytes = rpc::BytesOf(*posterior);
  for (v1::Sample& sample : *samples) {
    sample.clear_attempts();
    bytes += rpc::BytesOf(sample);
  }
  for (v1::SampleStates& of_sample : *states) {
    of_sample.clear_core_seconds();
    bytes += rpc::BytesOf(of_sample);
  }
  return bytes;
}

}  // namespace calib::testing
