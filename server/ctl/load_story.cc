#include "server/ctl/load_story.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "calib/return_if_error.h"
#include "server/client/findings.h"
#include "server/client/load_view.h"
#include "server/messages/read_words.h"
#include "server/report/views/predictions.h"

namespace calib::ctl {
namespace {

struct Known {
  report::Relative relative;
  bool finished = false;
};

report::ErrorStep StepOf(const report::CampaignView& view, bool held_out) {
  report::Comparison comparison = report::Compare(view, report::PredictReadings(view));
  return {.campaign = view.status.campaign(),
          .effects = view.campaign.model.effects,
          .rms_error = comparison.rms_error,
          .heldout_rms_error = held_out ? comparison.heldout_rms_error : std::nullopt,
          .by_observable = std::move(comparison.by_observable),
          .by_segment = std::move(comparison.by_segment)};
}

// The campaign behind its ancestors, base first; empty: it is not known.
std::vector<std::string> LineTo(const std::map<std::string, Known>& known,
                                const std::string& campaign) {
  std::vector<std::string> line;
  for (std::string at = campaign; known.contains(at); at = known.at(at).relative.parent) {
    if (std::find(line.begin(), line.end(), at) != line.end()) break;
    line.insert(line.begin(), at);
  }
  return line;
}

// The last one kept with `keeper` in which the campaign took part.
absl::StatusOr<std::optional<report::StoredImprovement>> ImprovementOf(client::Client& client,
                                                                       const std::string& campaign,
                                                                       const std::string& keeper) {
  ASSIGN_OR_RETURN(const auto findings, client.Findings(keeper));
  std::optional<report::StoredImprovement> last;
  for (const v1::Finding& finding : findings) {
    if (finding.kind() != client::kImprovement) continue;
    ASSIGN_OR_RETURN(const auto document, client.GetBlob(finding.digest()));
    auto improvement = report::ReadImprovement(document);
    if (!improvement.ok()) continue;
    const auto& steps = improvement->steps;
    const bool took_part = std::any_of(steps.begin(), steps.end(), [&campaign](const auto& step) {
      return step.campaign == campaign;
    });
    if (took_part) last = *std::move(improvement);
  }
  return last;
}

}  // namespace

absl::StatusOr<std::vector<report::StoredDiagnosis>> LoadDiagnoses(client::Client& client,
                                                                   const std::string& campaign) {
  std::vector<report::StoredDiagnosis> diagnoses;
  ASSIGN_OR_RETURN(const auto findings, client.Findings(campaign));
  for (const v1::Finding& finding : findings) {
    if (finding.kind() != client::kDiagnosis) continue;
    ASSIGN_OR_RETURN(const auto document, client.GetBlob(finding.digest()));
    auto diagnosis = report::ReadDiagnosis(document);
    if (!diagnosis.ok()) continue;
    diagnosis->digest = finding.digest();
    diagnosis->created_unix_ms = finding.created_unix_ms();
    diagnoses.push_back(*std::move(diagnosis));
  }
  return diagnoses;
}

absl::StatusOr<report::Story> LoadStory(client::Client& client, const report::CampaignView& view) {
  report::Story story;
  story.known = true;
  if (auto drift = report::ParameterDrifts(view); drift.ok()) story.drift = *std::move(drift);
  ASSIGN_OR_RETURN(const auto statuses, client.List());
  std::map<std::string, Known> known;
  for (const v1::CampaignStatus& status : statuses) {
    known[status.campaign()] = {
        .relative = {.campaign = status.campaign(),
                     .name = status.name(),
                     .parent = status.parent(),
                     .purpose = messages::PurposeOf(status),
                     .effects = {status.effects().begin(), status.effects().end()},
                     .log_evidence = std::nan("")},
        .finished = messages::StateOf(status) == campaign::CampaignState::kFinished};
  }
  const std::string& shown = view.status.campaign();
  std::vector<std::string> line = LineTo(known, shown);
  if (line.empty()) return story;  // deleted since
  // An improvement is kept with its first and its last campaign.
  for (const std::string& keeper : {shown, line.front()}) {
    if (story.improvement) break;
    ASSIGN_OR_RETURN(auto improvement, ImprovementOf(client, shown, keeper));
    story.improvement = std::move(improvement);
  }
  // All models on its way, those that it left again too.
  if (story.improvement) {
    const auto& steps = story.improvement->steps;
    std::vector<std::string> way = LineTo(known, steps.front().campaign);
    for (const report::ImprovedModel& step : steps) {
      const auto found = known.find(step.campaign);
      const bool there = found != known.end() && found->second.finished;
      if (there && std::find(way.begin(), way.end(), step.campaign) == way.end()) {
        way.push_back(step.campaign);
      }
    }
    line = std::move(way);
  }
  for (const std::string& id : line) {
    ASSIGN_OR_RETURN(auto diagnoses, LoadDiagnoses(client, id));
    std::move(diagnoses.begin(), diagnoses.end(), std::back_inserter(story.diagnoses));
  }
  const auto add = [&](const std::string& id) -> absl::Status {
    report::Relative relative = known.at(id).relative;
    const auto posterior = client.GetPosterior(id, std::nullopt);
    if (posterior.ok()) relative.log_evidence = posterior->log_evidence();
    if (line.front() == id) relative.parent.clear();
    story.family.push_back(std::move(relative));
    return absl::OkStatus();
  };
  for (const std::string& id : line) {
    RETURN_IF_ERROR(add(id));
    for (const auto& [other, entry] : known) {
      const bool on_line = std::find(line.begin(), line.end(), other) != line.end();
      const auto purpose = entry.relative.purpose;
      if (entry.relative.parent != id || on_line || !entry.finished ||
          (purpose != campaign::DerivedFor::kWarmFit &&
           purpose != campaign::DerivedFor::kExtension)) {
        continue;
      }
      RETURN_IF_ERROR(add(other));
    }
  }
  if (line.size() < 2) return story;
  for (const std::string& id : line) {
    const bool end = id == line.front() || id == line.back();
    if (id == view.status.campaign()) {
      story.steps.push_back(StepOf(view, end));
      continue;
    }
    ASSIGN_OR_RETURN(const auto ancestor, client::LoadView(client, id));
    story.steps.push_back(StepOf(ancestor, end));
  }
  return story;
}

}  // namespace calib::ctl
