#pragma once
// What changes, as it changes, for who shows all of it.

#include <grpcpp/support/server_callback.h>

#include "calib/v1/campaign.pb.h"
#include "server/service/calls.h"

namespace calib::service {

/// The stream of Campaigns.WatchChanges, until the peer cancels it. UNAUTHENTICATED once the caller
/// may not stay (Guard::Recheck).
grpc::ServerWriteReactor<v1::Changes>* WatchChanges(Core& core, Entry entry);

}  // namespace calib::service
