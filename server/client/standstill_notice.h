#pragma once
// A wait in which nothing goes on, because no worker is there or the server waits itself, says so.

#include <chrono>

#include "calib/v1/campaign.pb.h"
#include "server/client/session.h"

namespace calib::client {

/// Looks at the statuses that a verb waits on. Not thread-safe.
class StandstillNotice {
 public:
  /// session must outlive it. patience: how long nothing may run before the workers are counted.
  explicit StandstillNotice(Session& session, std::chrono::milliseconds patience = kPatience)
      : session_(session), patience_(patience) {}

  /// Call with every status that is waited on. Once nothing has run for as long as patience and no
  /// worker is connected, a line on standard error says what to do; again only after one has come.
  /// LookAtServer() is done as well.
  void Look(const v1::CampaignStatus& status);
  /// What the server waits for is said once, on standard error, and that it goes on.
  void LookAtServer(const v1::CampaignStatus& status);

  /// A worker that was just started has connected within this time [s].
  static constexpr std::chrono::seconds kPatience{5};

 private:
  Session& session_;
  std::chrono::milliseconds patience_;
  std::chrono::steady_clock::time_point idle_since_ = std::chrono::steady_clock::now();
  bool said_ = false;
  bool said_of_server_ = false;
};

}  // namespace calib::client
