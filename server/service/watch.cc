#include "server/service/watch.h"

#include "server/messages/read_words.h"
#include "server/service/queries.h"
#include "server/service/watcher.h"

namespace calib::service {
namespace {

constexpr std::chrono::milliseconds kPeriod{500};

class CampaignWatcher final : public Watcher<v1::CampaignStatus> {
 public:
  CampaignWatcher(Core& core, Entry entry, const std::string& campaign)
      : Watcher(core, std::move(entry), kPeriod) {
    const auto id = ParseCampaign(campaign);
    if (!id.ok()) {
      Finish(rpc::ToGrpc(id.status()));
      return;
    }
    campaign_ = *id;
    Begin();
  }

 private:
  void Fill() override {
    core_.Tell([this, live = core_.scheduler().Live(campaign_), waits = core_.WaitsFor()] {
      auto reader = core_.Read();
      auto status = Outgoing(reader.ok() ? StatusOf(*reader, campaign_, live, waits)
                                         : absl::StatusOr<v1::CampaignStatus>(reader.status()));
      if (!status.ok()) {
        Finish(rpc::ToGrpc(status.status()));
        return;
      }
      message_ = *std::move(status);
      StartWrite(&message_);
    });
  }

  bool IsLast() const override { return messages::IsOver(message_); }

  std::int64_t campaign_ = 0;
};

}  // namespace

grpc::ServerWriteReactor<v1::CampaignStatus>* WatchCampaign(Core& core, Entry entry,
                                                            const std::string& campaign) {
  return new CampaignWatcher(core, std::move(entry), campaign);
}

}  // namespace calib::service
