#pragma once
// One campaign as one self-contained HTML file.

#include <string>

#include "server/report/views/campaign_view.h"
#include "server/report/views/story.h"

namespace calib::report {

/// Needs nothing but itself: style and pictures are inside, no scripts, no links. Sections whose
/// data do not exist yet (no iteration complete) say so. Everything that came from users is
/// escaped. story: what was tried on the model and the drift of its parameters, if it is known.
std::string RenderReport(const CampaignView& view, const Story& story = {});

}  // namespace calib::report
