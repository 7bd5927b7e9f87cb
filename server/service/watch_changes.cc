#include "server/service/watch_changes.h"

#include "server/service/watcher.h"

namespace calib::service {
namespace {

/// Between two messages: as often as people can follow, and little work where states pour in.
constexpr std::chrono::milliseconds kBetweenChanges{1000};

class ChangesWatcher final : public Watcher<v1::Changes> {
 public:
  ChangesWatcher(Core& core, Entry entry) : Watcher(core, std::move(entry), kBetweenChanges) {
    Begin();
  }

 private:
  void Fill() override {
    Gather();
    if (!core_.WaitsFor().empty()) {  // what waits for room is told of when it is there
      StartWrite(&message_);
      return;
    }
    // An empty write, which is done when all before it is on disk, and costs nothing there.
    core_.WriteIfRoom([](store::Transaction& /*transaction*/) {},
                      [this](const absl::Status& /*status*/) {
                        if (const absl::Status end = WhyEnd(); !end.ok()) {
                          Finish(rpc::ToGrpc(end));
                        } else {
                          StartWrite(&message_);
                        }
                      });
  }

  void Gather() {
    scheduler::Scheduler& scheduler = core_.scheduler();
    message_.Clear();
    for (const auto& [id, at] : scheduler.changed()) {
      if (at.any <= seen_campaigns_) {
        continue;
      }
      v1::Changes::Campaign& campaign = *message_.add_campaigns();
      campaign.set_campaign(absl::StrCat("c", id));
      campaign.set_version(at.any);
      campaign.set_concluded(at.concluded);
      campaign.set_states_per_second(scheduler.StatesPerSecond(id));
    }
    message_.set_list(scheduler.list_changed());
    message_.set_workers(scheduler.workers_changed());
    message_.set_waits(core_.changes_of_room());
    seen_campaigns_ = scheduler.version();
  }

  std::uint64_t seen_campaigns_ = 0;
};

}  // namespace

grpc::ServerWriteReactor<v1::Changes>* WatchChanges(Core& core, Entry entry) {
  return new ChangesWatcher(core, std::move(entry));
}

}  // namespace calib::service
