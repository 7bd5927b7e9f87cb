#include "server/report/views/next_command.h"

#include "absl/strings/str_cat.h"
#include "server/messages/read_words.h"

namespace calib::report {
namespace {

std::string OfFinished(const std::string& campaign, const StoredDiagnosis* diagnosis,
                       bool improved) {
  if (diagnosis == nullptr || (diagnosis->only_adequacy && diagnosis->verdict != "adequate")) {
    return absl::StrCat("diagnose ", campaign);
  }
  if (diagnosis->verdict == "unexplained") return absl::StrCat("compare ", campaign);
  if (diagnosis->verdict == "adequate" || improved) {
    return absl::StrCat("report ", campaign, " -o ", campaign, ".html");
  }
  return absl::StrCat("improve ", campaign);
}

}  // namespace

std::string NextCommand(const v1::CampaignStatus& status, const StoredDiagnosis* diagnosis,
                        bool improved) {
  const std::string& id = status.campaign();
  const auto state = messages::StateOf(status);
  if (!state) return "";
  switch (*state) {
    case campaign::CampaignState::kQueued:
    case campaign::CampaignState::kRunning:
      return absl::StrCat("calibctl watch ", id);
    case campaign::CampaignState::kPaused:
      return absl::StrCat("calibctl resume ", id);
    case campaign::CampaignState::kFinished:
      return absl::StrCat("calibctl ", status.infers_nothing()
                                           ? absl::StrCat("export ", id, " -o ", id)
                                           : OfFinished(id, diagnosis, improved));
    case campaign::CampaignState::kFailed:
    case campaign::CampaignState::kCancelled:
      return "";
  }
  return "";
}

}  // namespace calib::report
