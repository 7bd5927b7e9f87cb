#include "server/page/askers.h"

#include <sys/resource.h>
#include <unistd.h>

#include <utility>

namespace calib::page {
namespace {

constexpr std::size_t kMostWaiting = 256;

}  // namespace

Askers::Askers(Connect connect, int threads, int niceness)
    : connect_(std::move(connect)), niceness_(niceness) {
  for (int i = 0; i < threads; ++i) {
    threads_.emplace_back([this](const std::stop_token& stop) { Run(stop); });
  }
}

Askers::~Askers() {
  for (std::jthread& thread : threads_) thread.request_stop();
  threads_.clear();
}

bool Askers::Ask(Work work) {
  const std::lock_guard lock(mutex_);
  if (waiting_.size() >= kMostWaiting) return false;
  waiting_.push_back(std::move(work));
  changed_.notify_one();
  return true;
}

void Askers::Run(const std::stop_token& stop) {
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), niceness_);
  std::unique_ptr<client::Client> client;
  while (true) {
    Work work;
    {
      std::unique_lock lock(mutex_);
      if (!changed_.wait(lock, stop, [this] { return !waiting_.empty(); }) ||
          stop.stop_requested()) {
        return;
      }
      work = std::move(waiting_.front());
      waiting_.pop_front();
    }
    if (client == nullptr) {
      auto made = connect_();
      if (!made.ok()) {
        (void)work(made.status());
        continue;
      }
      client = *std::move(made);
    }
    if (absl::IsUnavailable(work(client.get()))) client.reset();
  }
}

}  // namespace calib::page
