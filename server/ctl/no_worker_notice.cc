#include "server/ctl/no_worker_notice.h"

#include <algorithm>
#include <iostream>

namespace calib::ctl {

void NoWorkerNotice::Look(const v1::CampaignStatus& status) {
  const auto now = std::chrono::steady_clock::now();
  const bool waits = status.state() == "queued" || status.state() == "running";
  if (!waits || status.samples_running() > 0) {
    idle_since_ = now;
    said_ = false;
    return;
  }
  if (said_ || now - idle_since_ < patience_) return;
  idle_since_ = now;
  const auto workers = session_.client().ListWorkers();
  if (!workers.ok() || std::any_of(workers->begin(), workers->end(),
                                   [](const v1::WorkerInfo& w) { return w.connected(); })) {
    return;
  }
  said_ = true;
  std::cerr << "\nno worker is connected to " << session_.address() << ", so nothing runs: start `"
            << "calib-worker --server " << session_.address()
            << "`, or stop this and give --state DIR --workers N (nothing is lost)\n";
}

}  // namespace calib::ctl
