#include "server/campaign/file/read_noise_groups.h"

#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "server/campaign/file/shared/read_prior.h"
#include "server/campaign/file/text/suggestion.h"

namespace calib::campaign {
namespace {

using Member = std::pair<int, int>;

// (experiment, observable) of "stress_ratio" or "tx02.stress_ratio", of experiments that calibrate.
std::vector<Member> MembersOf(const Campaign& campaign, const std::string& name) {
  std::vector<Member> members;
  for (std::size_t e = 0; e < campaign.experiments.size(); ++e) {
    const Experiment& experiment = campaign.experiments[e];
    if (experiment.role != Role::kCalibrate) continue;
    for (std::size_t j = 0; j < experiment.observables.size(); ++j) {
      const std::string& observable = experiment.observables[j].name;
      if (name == observable || name == absl::StrCat(experiment.name, ".", observable)) {
        members.emplace_back(static_cast<int>(e), static_cast<int>(j));
      }
    }
  }
  return members;
}

std::vector<std::string> AllNames(const Campaign& campaign) {
  std::set<std::string> plain;
  for (const Experiment& experiment : campaign.experiments) {
    if (experiment.role != Role::kCalibrate) continue;
    for (const MeasuredObservable& observable : experiment.observables)
      plain.insert(observable.name);
  }
  return {plain.begin(), plain.end()};
}

// The members of a group; those of other groups are taken.
std::vector<Member> ReadMembers(MapReader& map, const Campaign& campaign, const char* shared,
                                std::set<Member>& taken) {
  std::vector<Member> all;
  if (map.Require("observables", absl::StrCat("the names whose errors share ", shared)) !=
      nullptr) {
    for (const std::string& name :
         map.TextList("observables").value_or(std::vector<std::string>{})) {
      const std::vector<Member> members = MembersOf(campaign, name);
      if (members.empty()) {
        map.Problem("observables",
                    absl::StrCat("'", name, "' is not fitted in any experiment; fitted are ",
                                 Listed(AllNames(campaign)), ", alone or as EXPERIMENT.NAME"));
      }
      for (const Member& member : members) {
        if (taken.insert(member).second) {
          all.push_back(member);
        } else {
          map.Problem("observables",
                      absl::StrCat("'", name, "' stands in two groups; its errors have ", shared));
        }
      }
    }
  }
  return all;
}

void ReadFactor(const YamlNode& node, const std::string& path, std::set<Member>& taken,
                Campaign& campaign, ProblemList& problems) {
  MapReader map(node, path, SectionOf("noise_group"), problems);
  if (node.kind != YamlNode::Kind::kMap) return;
  SharedNoise shared{.members = ReadMembers(map, campaign, "one factor", taken)};
  shared.prior.shape = map.Quantity("shape").value_or(shared.prior.shape);
  shared.prior.rate = map.Quantity("rate").value_or(shared.prior.rate);
  map.Finish();
  if (!shared.members.empty()) campaign.shared_noise.push_back(std::move(shared));
}

const MeasuredObservable& ObservableOf(const Campaign& campaign, const Member& member) {
  return campaign.experiments[static_cast<std::size_t>(member.first)]
      .observables[static_cast<std::size_t>(member.second)];
}

void ReadModelError(const YamlNode& node, const std::string& path, std::set<Member>& taken,
                    Campaign& campaign, ProblemList& problems) {
  MapReader map(node, path, SectionOf("model_error"), problems);
  if (node.kind != YamlNode::Kind::kMap) return;
  inference::ModelError error{.members = ReadMembers(map, campaign, "one model error", taken)};
  if (const YamlNode* scale = map.Find("relative")) {
    error.relative = ReadErrorScale(*scale, map.PathOf("relative"), "1", problems);
  }
  if (!map.Has("relative") && !map.Has("absolute")) {
    problems.Add(map.line(), map.path(),
                 "needs relative, absolute or both, e.g. relative: {prior: uniform, min: 0, max: "
                 "0.2}");
  }
  const YamlNode* absolute = map.Find("absolute");
  if (absolute != nullptr && !error.members.empty()) {
    const std::string& unit = ObservableOf(campaign, error.members.front()).unit;
    for (const Member& member : error.members) {
      if (ObservableOf(campaign, member).unit == unit) continue;
      map.Problem("absolute", absl::StrCat("is one standard deviation for observables in ", unit,
                                           " and in ", ObservableOf(campaign, member).unit,
                                           "; put them into entries of their own"));
      return;
    }
    error.absolute = ReadErrorScale(*absolute, map.PathOf("absolute"), unit, problems);
  }
  map.Finish();
  if (!error.members.empty() && (error.relative || error.absolute)) {
    campaign.model_errors.push_back(std::move(error));
  }
}

}  // namespace

void ReadNoiseGroups(MapReader& campaign_map, Campaign& campaign) {
  const YamlNode* node = campaign_map.Find("noise");
  if (node == nullptr || node->kind != YamlNode::Kind::kMap) return;
  for (const YamlEntry& entry : node->entries) {
    const bool factors = entry.key == "inferred";
    if (!factors && entry.key != "model_error") continue;
    const std::string path = "noise." + entry.key;
    if (entry.value.kind != YamlNode::Kind::kSequence || entry.value.items.empty()) {
      campaign_map.problems().Add(
          entry.line, path,
          absl::StrCat("has to be a list of groups, each with its observables",
                       factors ? "; without groups write noise: inferred" : ""));
      return;
    }
    std::set<Member> taken;
    for (std::size_t i = 0; i < entry.value.items.size(); ++i) {
      (factors ? ReadFactor : ReadModelError)(entry.value.items[i],
                                              absl::StrCat(path, "[", i + 1, "]"), taken, campaign,
                                              campaign_map.problems());
    }
  }
}

}  // namespace calib::campaign
