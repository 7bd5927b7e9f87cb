#pragma once
// What pause, resume and cancel have in common: one call that answers with the new status.

#include "server/client/client.h"
#include "server/ctl/arguments.h"

namespace calib::ctl {

using ControlCall =
    absl::StatusOr<v1::CampaignStatus> (client::Client::*)(const std::string& campaign);

/// Makes the call and prints the status; returns the exit code.
int Control(const Arguments& arguments, ControlCall call);

}  // namespace calib::ctl
