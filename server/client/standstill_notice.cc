#include "server/client/standstill_notice.h"

#include <algorithm>
#include <iostream>
#include <string>

#include "server/campaign/file/text/yaml_text.h"
#include "server/messages/read_words.h"

namespace calib::client {

using campaign::CampaignState;

namespace {

// Runs that were made elsewhere are there.
bool NeedsWorkers(Client& client, const std::string& campaign) {
  const auto source = client.GetSource(campaign);
  if (!source.ok()) return false;
  const auto parsed = campaign::ParseYaml(source->campaign_file());
  const auto* model = parsed.root ? campaign::YamlFind(*parsed.root, "model") : nullptr;
  return model == nullptr || campaign::YamlFind(*model, "precomputed") == nullptr;
}

}  // namespace

void StandstillNotice::Look(const v1::CampaignStatus& status) {
  LookAtServer(status);
  const auto now = std::chrono::steady_clock::now();
  const auto state = messages::StateOf(status);
  const bool lives = state == CampaignState::kQueued || state == CampaignState::kRunning;
  const bool computes = messages::PhaseOf(status) == campaign::Phase::kCalibrating &&
                        status.samples_done() > 0 && status.samples_done() >= status.samples();
  if (!lives || computes || status.samples_running() > 0 || !status.server_waits().empty()) {
    idle_since_ = now;
    said_ = false;
    return;
  }
  if (said_ || now - idle_since_ < patience_) return;
  idle_since_ = now;
  if (!status.nobody_may().empty()) {
    said_ = true;
    std::cerr << "\nnothing runs: " << status.nobody_may() << "\n";
    return;
  }
  if (!NeedsWorkers(session_.client(), status.campaign())) return;
  const auto workers = session_.client().ListWorkers();
  if (!workers.ok() || std::any_of(workers->begin(), workers->end(),
                                   [](const v1::WorkerInfo& w) { return w.connected(); })) {
    return;
  }
  said_ = true;
  std::cerr << "\nno worker is connected to " << session_.address() << ", so nothing runs: start `"
            << "calib-worker --server " << session_.address()
            << (session_.shows_certificate() ? " --tls DIR" : "")
            << "`, or stop this and give --state DIR --workers N (nothing is lost)\n";
}

void StandstillNotice::LookAtServer(const v1::CampaignStatus& status) {
  const bool waits = !status.server_waits().empty();
  if (waits == said_of_server_) return;
  said_of_server_ = waits;
  std::cerr << "\n"
            << (waits ? status.server_waits()
                      : "the disk takes what is written again, and the server goes on")
            << "\n";
}

}  // namespace calib::client
