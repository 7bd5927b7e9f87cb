#pragma once
// A finished campaign made up from closed formulas, for tests of everything that reads a
// CampaignView.

#include "server/report/views/campaign_view.h"

namespace calib::report::testing {

/// Two experiments (one held out), three parameters, two iterations of 60 samples; `name` is the
/// campaign's.
CampaignView ExampleView(const std::string& name);

}  // namespace calib::report::testing
