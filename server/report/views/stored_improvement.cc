#include "server/report/views/stored_improvement.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "server/report/views/lenient_json.h"

namespace calib::report {

absl::StatusOr<StoredImprovement> ReadImprovement(const std::string& text) {
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
  const auto steps = json.is_object() ? json.find("steps") : json.end();
  if (!json.is_object() || steps == json.end() || !steps->is_array()) {
    return absl::InvalidArgumentError("the document kept as an improvement is none");
  }
  StoredImprovement improvement;
  for (const nlohmann::json& step : *steps) {
    ImprovedModel model;
    if (!step.is_object()) continue;
    Read(step, "campaign", model.campaign);
    Read(step, "verdict", model.verdict);
    Read(step, "reason", model.reason);
    Read(step, "left_out_error", model.left_out_error);
    if (!model.campaign.empty()) improvement.steps.push_back(std::move(model));
  }
  Read(json, "verdict_digest", improvement.verdict_digest);
  Read(json, "opened_before", improvement.opened_before);
  return improvement;
}

}  // namespace calib::report
