#pragma once
// The document of a diagnosis by probabilities of the example campaign, made up.

#include <string>

#include "server/report/views/campaign_view.h"

namespace calib::report::testing {

/// As `calibctl diagnose --json` writes it; of ExampleView(), whose fitted curves two of the
/// effects would change.
std::string ExampleDiagnosis(const CampaignView& view);

}  // namespace calib::report::testing
