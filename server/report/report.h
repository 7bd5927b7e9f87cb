#pragma once
// One campaign as one self-contained HTML file.

#include <string>

#include "server/report/campaign_view.h"

namespace calib::report {

/// Needs nothing but itself: style and pictures are inside, no scripts, no links. Sections whose
/// data do not exist yet (no iteration complete) say so. Everything that came from users is
/// escaped.
std::string RenderReport(const CampaignView& view);

}  // namespace calib::report
