#include "server/service/watch_changes.h"

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>

#include "proto/rpc/status.h"

namespace calib::service {
namespace {

/// Between two messages: as often as people can follow, and little work where states pour in.
constexpr std::chrono::milliseconds kBetweenChanges{1000};

/// Goes round on the strand: look, wait for the disk, write, wait. Deletes itself.
class ChangesWatcher final : public grpc::ServerWriteReactor<v1::Changes> {
 public:
  ChangesWatcher(Core& core, Entry entry)
      : core_(core), entry_(std::move(entry)), timer_(core.strand()) {
    core_.Post([this] { Look(); });
  }

  void OnWriteDone(bool ok) override {
    core_.Post([this, ok] {
      if (ok) {
        Wait();
      } else {
        Finish(grpc::Status::CANCELLED);
      }
    });
  }

  void OnCancel() override {
    core_.Post([this] {
      cancelled_ = true;
      timer_.cancel();
    });
  }

  void OnDone() override {
    // OnCancel comes before OnDone, so what it posted to the strand has run when this does.
    core_.Post([this] { delete this; });
  }

 private:
  void Wait() {
    timer_.expires_after(kBetweenChanges);
    timer_.async_wait([this](const boost::system::error_code& /*error*/) {
      if (!cancelled_ && core_.health().ok() && core_.version() == seen_ &&
          core_.guard().Recheck(entry_.caller).ok()) {
        Wait();
      } else {
        Look();
      }
    });
  }

  /// Why the stream ends; OK: it goes on.
  absl::Status WhyEnd() {
    if (cancelled_) {
      return absl::CancelledError("");
    }
    if (!core_.health().ok()) {
      return core_.health();
    }
    const absl::Status welcome = core_.guard().Recheck(entry_.caller);
    if (!welcome.ok()) {
      core_.door().LogRefusal(entry_.caller.peer, welcome);
    }
    return welcome;
  }

  void Look() {
    if (const absl::Status end = WhyEnd(); !end.ok()) {
      Finish(rpc::ToGrpc(end));
      return;
    }
    Fill();
    if (!core_.WaitsFor().empty()) {  // what waits for room is told of when it is there
      StartWrite(&changes_);
      return;
    }
    // An empty write, which is done when all before it is on disk, and costs nothing there.
    core_.WriteIfRoom([](store::Transaction& /*transaction*/) {},
                      [this](const absl::Status& /*status*/) {
                        if (const absl::Status end = WhyEnd(); !end.ok()) {
                          Finish(rpc::ToGrpc(end));
                        } else {
                          StartWrite(&changes_);
                        }
                      });
  }

  void Fill() {
    scheduler::Scheduler& scheduler = core_.scheduler();
    changes_.Clear();
    for (const auto& [id, at] : scheduler.changed()) {
      if (at.any <= seen_campaigns_) {
        continue;
      }
      v1::Changes::Campaign& campaign = *changes_.add_campaigns();
      campaign.set_campaign(absl::StrCat("c", id));
      campaign.set_version(at.any);
      campaign.set_concluded(at.concluded);
      campaign.set_states_per_second(scheduler.StatesPerSecond(id));
    }
    changes_.set_list(scheduler.list_changed());
    changes_.set_workers(scheduler.workers_changed());
    changes_.set_waits(core_.changes_of_room());
    seen_campaigns_ = scheduler.version();
    seen_ = core_.version();
  }

  Core& core_;
  const Entry entry_;
  boost::asio::steady_timer timer_;  // the strand's, like everything below
  std::uint64_t seen_ = 0;
  std::uint64_t seen_campaigns_ = 0;
  bool cancelled_ = false;
  v1::Changes changes_;
};

}  // namespace

grpc::ServerWriteReactor<v1::Changes>* WatchChanges(Core& core, Entry entry) {
  return new ChangesWatcher(core, std::move(entry));
}

}  // namespace calib::service
