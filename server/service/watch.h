#pragma once
// The live view of one campaign.

#include <grpcpp/support/server_callback.h>

#include <string>

#include "calib/v1/campaign.pb.h"
#include "server/service/calls.h"

namespace calib::service {

/// One status at once, then one whenever something changed, at most two a second, until the
/// campaign is over. UNAUTHENTICATED once the caller may not stay (Guard::Recheck).
grpc::ServerWriteReactor<v1::CampaignStatus>* WatchCampaign(Core& core, Entry entry,
                                                            const std::string& campaign);

}  // namespace calib::service
