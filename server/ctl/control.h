#pragma once
// What pause, resume and cancel have in common: one call that answers with the new status.

#include <string>

#include "server/client/client.h"
#include "server/ctl/verb.h"

namespace calib::ctl {

using ControlCall =
    absl::StatusOr<v1::CampaignStatus> (client::Client::*)(const std::string& campaign);

/// The verb on one campaign that makes the call and prints the status it answers with.
Verb ControlVerb(const std::string& name, const std::string& description, ControlCall call);

}  // namespace calib::ctl
