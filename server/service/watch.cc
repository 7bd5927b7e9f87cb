#include "server/service/watch.h"

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>

#include "proto/rpc/status.h"
#include "server/messages/read_words.h"
#include "server/service/queries.h"

namespace calib::service {
namespace {

constexpr std::chrono::milliseconds kPeriod{500};

/// Goes round: look on the strand, read on the pool, write, wait. Deletes itself.
class Watcher final : public grpc::ServerWriteReactor<v1::CampaignStatus> {
 public:
  Watcher(Core& core, Entry entry, const std::string& campaign)
      : core_(core), entry_(std::move(entry)), timer_(core.strand()) {
    const auto id = ParseCampaign(campaign);
    if (!id.ok()) {
      Finish(rpc::ToGrpc(id.status()));
      return;
    }
    campaign_ = *id;
    core_.Post([this] { Look(); });
  }

  void OnWriteDone(bool ok) override {
    core_.Post([this, ok] {
      if (!ok) {
        Finish(grpc::Status::CANCELLED);
      } else if (messages::IsOver(status_)) {
        Finish(grpc::Status::OK);
      } else {
        Wait();
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
    timer_.expires_after(kPeriod);
    timer_.async_wait([this](const boost::system::error_code& /*error*/) {
      if (!cancelled_ && core_.health().ok() && core_.version() == seen_ &&
          core_.guard().Recheck(entry_.caller).ok()) {
        Wait();
      } else {
        Look();
      }
    });
  }

  void Look() {
    if (cancelled_) {
      Finish(grpc::Status::CANCELLED);
      return;
    }
    if (!core_.health().ok()) {
      Finish(rpc::ToGrpc(core_.health()));
      return;
    }
    if (const absl::Status welcome = core_.guard().Recheck(entry_.caller); !welcome.ok()) {
      core_.door().LogRefusal(entry_.caller.peer, welcome);
      Finish(rpc::ToGrpc(welcome));
      return;
    }
    seen_ = core_.version();
    core_.Tell([this, live = core_.scheduler().Live(campaign_), waits = core_.WaitsFor()] {
      auto reader = core_.Read();
      auto status = Outgoing(reader.ok() ? StatusOf(*reader, campaign_, live, waits)
                                         : absl::StatusOr<v1::CampaignStatus>(reader.status()));
      if (!status.ok()) {
        Finish(rpc::ToGrpc(status.status()));
        return;
      }
      status_ = *std::move(status);
      StartWrite(&status_);
    });
  }

  Core& core_;
  const Entry entry_;
  boost::asio::steady_timer timer_;  // the strand's, like everything below but status_
  std::int64_t campaign_ = 0;
  std::uint64_t seen_ = 0;
  bool cancelled_ = false;
  v1::CampaignStatus status_;
};

}  // namespace

grpc::ServerWriteReactor<v1::CampaignStatus>* WatchCampaign(Core& core, Entry entry,
                                                            const std::string& campaign) {
  return new Watcher(core, std::move(entry), campaign);
}

}  // namespace calib::service
