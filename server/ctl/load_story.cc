#include "server/ctl/load_story.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "server/campaign/yaml_text.h"
#include "server/ctl/load_view.h"
#include "server/report/predictions.h"

namespace calib::ctl {
namespace {

struct Known {
  report::Relative relative;
  bool finished = false;
};

// What a campaign's text says of itself, without its files.
report::Relative RelativeOf(const v1::CampaignStatus& status, const std::string& yaml) {
  report::Relative r{.campaign = status.campaign(),
                     .name = status.name(),
                     .parent = "",
                     .purpose = "",
                     .effects = {},
                     .log_evidence = std::nan("")};
  const auto parsed = campaign::ParseYaml(yaml);
  if (!parsed.root) return r;
  if (const auto* lineage = campaign::YamlFind(*parsed.root, "lineage"); lineage != nullptr) {
    if (const auto* parent = campaign::YamlFind(*lineage, "parent")) r.parent = parent->scalar;
    if (const auto* purpose = campaign::YamlFind(*lineage, "purpose")) r.purpose = purpose->scalar;
  }
  if (const auto* model = campaign::YamlFind(*parsed.root, "model"); model != nullptr) {
    if (const auto* effects = campaign::YamlFind(*model, "effects"); effects != nullptr) {
      for (const auto& item : effects->items) r.effects.push_back(item.scalar);
      if (effects->items.empty() && !effects->scalar.empty() && effects->scalar != "none") {
        r.effects.push_back(effects->scalar);
      }
    }
  }
  return r;
}

report::ErrorStep StepOf(const report::CampaignView& view, bool held_out) {
  report::Comparison comparison = report::Compare(view, report::PredictReadings(view));
  return {.campaign = view.status.campaign(),
          .effects = view.campaign.model.effects,
          .rms_error = comparison.rms_error,
          .heldout_rms_error = held_out ? comparison.heldout_rms_error : std::nullopt,
          .by_observable = std::move(comparison.by_observable)};
}

}  // namespace

absl::StatusOr<report::Story> LoadStory(Client& client, const report::CampaignView& view) {
  report::Story story;
  if (auto drift = report::ParameterDrifts(view); drift.ok()) story.drift = *std::move(drift);
  const auto statuses = client.List();
  if (!statuses.ok()) return statuses.status();
  std::map<std::string, Known> known;
  for (const v1::CampaignStatus& status : *statuses) {
    const auto source = client.GetSource(status.campaign());
    if (!source.ok()) return source.status();
    known[status.campaign()] = {.relative = RelativeOf(status, source->campaign_file()),
                                .finished = status.state() == "finished"};
  }
  // The line of ancestors, base first.
  std::vector<std::string> line;
  for (std::string at = view.status.campaign(); known.contains(at);
       at = known.at(at).relative.parent) {
    if (std::find(line.begin(), line.end(), at) != line.end()) break;
    line.insert(line.begin(), at);
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
    if (auto status = add(id); !status.ok()) return status;
    for (const auto& [other, entry] : known) {
      const bool on_line = std::find(line.begin(), line.end(), other) != line.end();
      const std::string& purpose = entry.relative.purpose;
      if (entry.relative.parent != id || on_line || !entry.finished ||
          (purpose != "warm_fit" && purpose != "extension")) {
        continue;
      }
      if (auto status = add(other); !status.ok()) return status;
    }
  }
  if (line.size() < 2) return story;
  for (const std::string& id : line) {
    const bool end = id == line.front() || id == line.back();
    if (id == view.status.campaign()) {
      story.steps.push_back(StepOf(view, end));
      continue;
    }
    const auto ancestor = LoadView(client, id);
    if (!ancestor.ok()) return ancestor.status();
    story.steps.push_back(StepOf(*ancestor, end));
  }
  return story;
}

}  // namespace calib::ctl
