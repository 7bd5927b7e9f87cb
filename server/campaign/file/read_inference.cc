#include "server/campaign/file/read_inference.h"

#include <algorithm>
#include <map>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "server/campaign/file/read_rows.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/keys/bounds.h"
#include "server/campaign/keys/words.h"

namespace calib::campaign {
namespace {

using inference::NoiseMode;

void ReadNoiseMode(MapReader& map, inference::FilterOptions& filter) {
  const YamlNode* node = map.Find("noise");
  if (node == nullptr) return;
  if (node->kind == YamlNode::Kind::kMap) {
    auto noise = map.Map("noise");
    if (noise->Has("inferred")) {  // its groups are read once the experiments are known
      filter.noise = NoiseMode::kInferred;
      noise->Ignore({"inferred"});
      noise->Finish();
      return;
    }
    if (noise->Has("model_error")) {  // likewise
      filter.noise = NoiseMode::kModelError;
      noise->Ignore({"model_error"});
      noise->Finish();
      return;
    }
    noise->Require("ess_target",
                   "allowed: given, inferred, {inferred: [...]}, {model_error: [...]} or "
                   "{ess_target: 0.2}");
    filter.noise = NoiseMode::kEssTarget;
    filter.ess_target = noise->Quantity("ess_target").value_or(filter.ess_target);
    noise->Finish();
    return;
  }
  const NoiseMode mode = map.Choice("noise", kNoiseModeWords).value_or(filter.noise);
  if (mode == NoiseMode::kModelError) {
    map.Problem("noise",
                "names a model error without saying of what; write {model_error: [{observables: "
                "[NAME], relative: {prior: uniform, min: 0, max: 0.2}}]}");
    return;
  }
  filter.noise = mode;
}

void ReadMethodName(MapReader& map, const MethodList& methods, Campaign& campaign) {
  if (const auto name = map.Choice("method")) campaign.method = methods.Find(*name);
  const Method& method = *campaign.method;
  if (campaign.precomputed && !method.takes_made_runs()) {
    map.Problem("method",
                absl::StrCat(method.name(),
                             RunsAreAdded(campaign) ? " is for runs still to be made; those"
                                                    : " chooses its own samples, and runs",
                             " that exist already are what they are; use ",
                             methods.NamesOf(&Method::takes_made_runs)));
  } else if (campaign.filter.noise == NoiseMode::kEssTarget && method.needs_errors()) {
    map.Problem("method", absl::StrCat(method.name(),
                                       " needs the errors of the readings; use noise: "
                                       "given or noise: inferred with it"));
  }
}

void ReadDecisions(MapReader& map, const MethodList& methods, Campaign& campaign) {
  if (map.Choice("decisions", kDecisionsWords) != Decisions::kImmediate) return;
  if (!campaign.method->may_decide_at_once()) {
    map.Problem("decisions", absl::StrCat(campaign.method->name(),
                                          " decides nothing while runs are under way; immediate "
                                          "is for ",
                                          methods.NamesOf(&Method::may_decide_at_once)));
    return;
  }
  campaign.decisions = Decisions::kImmediate;
}

std::vector<std::string> OwnKeys(const Method& method) {
  std::vector<std::string> names;
  for (const Section& section : method.Keys()) {
    for (const Key& key : section.keys) names.push_back(key.name);
    break;  // those behind it are of keys of these
  }
  return names;
}

// Keys that this method does not read.
void RefuseKeysOfOthers(MapReader& map, const MethodList& methods, const Method& method) {
  const std::vector<std::string> own = OwnKeys(method);
  std::map<std::string, std::vector<std::string>> owners;  // by key
  for (const auto& other : methods.all()) {
    for (const std::string& key : OwnKeys(*other)) {
      if (std::find(own.begin(), own.end(), key) == own.end()) {
        owners[key].emplace_back(other->name());
      }
    }
  }
  for (const auto& [key, names] : owners) {
    map.Ignore({key});
    if (map.Has(key)) {
      map.Problem(
          key, absl::StrCat("belongs to method: ", absl::StrJoin(names, " and "), "; remove it"));
    }
  }
  const auto refuse = [&map](const char* key, const std::string& why) {
    map.Ignore({key});
    if (map.Has(key)) map.Problem(key, why);
  };
  if (!method.takes_first_proposal()) {
    refuse("first_proposal", absl::StrCat("is not for ", method.name(), "; remove it"));
  }
  if (method.chosen_by() != ChosenBy::kRequest) return;
  for (const char* key : {"samples", "max_iterations", "replicates"}) {
    refuse(key, "belongs to methods that choose their samples; remove it");
  }
}

void ReadMethodSection(MapReader& campaign_map, const MethodList& methods, Campaign& campaign) {
  campaign.method = methods.standard();
  const Section section = InferenceSection(methods);
  auto map = campaign_map.Map("inference", section);
  if (map) ReadMethodName(*map, methods, campaign);
  const std::shared_ptr<const Method> method = campaign.method;
  campaign.max_iterations = method->standard_iterations();
  if (!map) return;
  if (RunsAreAdded(campaign)) {
    campaign.samples = kMostRowsOfBatch;
  } else {
    campaign.samples =
        static_cast<int>(map->Integer("samples", method->fewest_samples(0), kMostSamples)
                             .value_or(campaign.samples));
    campaign.max_iterations =
        static_cast<int>(map->Integer("max_iterations").value_or(campaign.max_iterations));
    if (const auto replicates = map->Integer("replicates")) {
      campaign.replicates = static_cast<int>(*replicates);
    }
  }
  campaign.method = method->Read(*map, campaign);
  ReadDecisions(*map, methods, campaign);
  RefuseKeysOfOthers(*map, methods, *method);
  map->Ignore({"rows", "first_proposal"});  // read once the parameters are known
  map->Finish();
}

/// Numbers within (0, 1), increasing; empty after a problem.
std::vector<double> ReadRungs(MapReader& map) {
  const YamlNode* node = map.Find("rungs");
  if (node == nullptr) return {};
  if (node->kind != YamlNode::Kind::kSequence || node->items.empty()) {
    map.Problem("rungs", "has to be a list of shares of the load steps, e.g. [0.25, 0.5]");
    return {};
  }
  std::vector<double> rungs;
  for (const YamlNode& item : node->items) {
    const auto rung = map.QuantityIn("rungs", item);
    if (!rung.has_value()) return {};
    if (!rungs.empty() && *rung <= rungs.back()) {
      map.Problem("rungs", absl::StrCat("has ", *rung, " after ", rungs.back(),
                                        "; each rung has to be above the one before"));
      return {};
    }
    rungs.push_back(*rung);
  }
  return rungs;
}

void ReadEarlyStopping(MapReader& campaign_map, const MethodList& methods, Campaign& campaign) {
  const YamlNode* node = campaign_map.Find("early_stopping");
  if (node == nullptr) return;
  if (node->kind == YamlNode::Kind::kScalar &&
      (node->scalar == "off" || node->scalar == "none" || node->scalar == "false")) {
    return;
  }
  auto map = campaign_map.Map("early_stopping");
  if (!map) return;
  const YamlNode* discard = map->Find("discard_at_most");
  const bool off =
      discard != nullptr && discard->kind == YamlNode::Kind::kScalar && discard->scalar == "off";
  EarlyStopping stopping;
  map->Require("discard_at_most", "the posterior mass that stopping early may lose, e.g. 1e-3");
  if (!off) {
    stopping.discard_at_most = map->Quantity("discard_at_most").value_or(stopping.discard_at_most);
  }
  stopping.rungs = ReadRungs(*map);
  stopping.exponent = map->Quantity("exponent");
  if (!stopping.rungs.empty() && campaign.program) {
    map->Problem("rungs",
                 "rest and go on, which a program (model.command) cannot: each would begin anew; "
                 "leave them out");
  }
  if (!stopping.rungs.empty() && !campaign.method->weighs_samples()) {
    map->Problem("rungs", absl::StrCat("is for ", methods.NamesOf(&Method::weighs_samples),
                                       "; others judge each run on its own"));
  } else if (!stopping.rungs.empty() && campaign.decisions == Decisions::kImmediate) {
    map->Problem("rungs",
                 "makes samples wait for each other, which inference.decisions: immediate does "
                 "not; remove one of the two");
  }
  map->Finish();
  if (RunsAreAdded(campaign) && !off) {
    campaign_map.Problem("early_stopping",
                         "is for campaigns that infer; the runs of a design go to their ends");
    return;
  }
  // A tempered likelihood has no bound that could be kept, and runs that exist already have nothing
  // to stop.
  if (!off && campaign.filter.noise != NoiseMode::kEssTarget && !campaign.precomputed &&
      campaign.method->bounds_runs()) {
    campaign.early_stopping = stopping;
  }
}

void ReadFailure(MapReader& campaign_map, Campaign& campaign) {
  auto map = campaign_map.Map("failure");
  if (!map) return;
  campaign.failure.attempts =
      static_cast<int>(map->Integer("attempts").value_or(campaign.failure.attempts));
  campaign.failure.pause_above =
      map->Quantity("pause_above").value_or(campaign.failure.pause_above);
  if (const auto at_limit = map->Choice("at_limit")) {
    if (campaign.program) {
      campaign.program->limit_diverges = *at_limit == "diverged";
    } else {
      map->Problem("at_limit", "is of a program (model.command), whose limits a run can come to");
    }
  }
  map->Finish();
}

void ReadBudget(MapReader& campaign_map, Campaign& campaign) {
  auto map = campaign_map.Map("budget");
  if (!map) return;
  if (RunsAreAdded(campaign)) {
    map->Ignore(map->Keys());
    campaign_map.Problem("budget",
                         "is for campaigns that infer; a design runs what is added to it");
    return;
  }
  campaign.budget.model_evaluations = map->Integer("model_evaluations");
  campaign.budget.core_hours = map->Quantity("core_hours");
  map->Finish();
}

void ReadFirstProposal(MapReader& inference_map, Campaign& campaign) {
  if (!inference_map.Has("first_proposal")) return;
  auto map = inference_map.Map("first_proposal");
  if (!map) return;
  FirstProposal proposal;
  proposal.prior_share = map->Quantity("prior_share").value_or(proposal.prior_share);
  for (const CalibratedParameter& parameter : campaign.parameters) {
    if (!map->Has(parameter.name)) continue;
    auto place = map->Map(parameter.name);
    if (!place) continue;
    place->Require("center", "where samples of this parameter are drawn");
    place->Require("sd", "how widely samples of this parameter are drawn");
    const auto center = place->Quantity("center", parameter.unit, {});
    const auto sd = place->Quantity("sd", parameter.unit, kPositive);
    place->Finish();
    if (!center || !sd) continue;
    if (!parameter.prior.InSupport(*center)) {
      place->Problem("center", "lies outside the prior of the parameter");
      continue;
    }
    proposal.places[parameter.name] = {.center = *center, .sd = *sd};
  }
  map->Finish();
  campaign.first_proposal = std::move(proposal);
}

void ReadLineage(MapReader& campaign_map, Campaign& campaign) {
  auto map = campaign_map.Map("lineage");
  if (!map) return;
  Lineage lineage;
  lineage.parent =
      map->RequiredText("parent", "id of the campaign this one comes from").value_or("");
  lineage.purpose = map->RequiredText("purpose", "why it was derived").value_or("");
  map->Finish();
  campaign.lineage = std::move(lineage);
}

}  // namespace

void ReadStart(MapReader& campaign_map, const MethodList& methods, Campaign& campaign) {
  ReadLineage(campaign_map, campaign);
  if (!campaign_map.Has("inference")) return;
  const Section section = InferenceSection(methods);
  auto map = campaign_map.Map("inference", section);
  if (!map) return;
  if (campaign.method->takes_rows()) ReadRows(*map, campaign);
  campaign.method->Check(*map, campaign);
  if (campaign.method->takes_first_proposal()) ReadFirstProposal(*map, campaign);
}

void ReadInference(MapReader& campaign_map, const MethodList& methods, Campaign& campaign) {
  ReadNoiseMode(campaign_map, campaign.filter);
  ReadMethodSection(campaign_map, methods, campaign);
  ReadEarlyStopping(campaign_map, methods, campaign);
  ReadFailure(campaign_map, campaign);
  ReadBudget(campaign_map, campaign);
  campaign.seed = campaign_map.Seed("seed").value_or(campaign.seed);
  campaign.filter.seed = campaign.seed;
}

void CheckSamples(MapReader& campaign_map, const Campaign& campaign) {
  const int fewest = campaign.method->fewest_samples(campaign.parameters.size());
  if (RunsRowsOnly(campaign) || campaign.samples >= fewest) return;
  campaign_map.Problem("inference",
                       absl::StrCat("samples is ", campaign.samples, "; ", campaign.method->name(),
                                    " starts from at least ", fewest, " for ",
                                    campaign.parameters.size(), " parameters"));
}

void CheckReplicates(const MapReader& campaign_map, const Campaign& campaign) {
  if (campaign.replicates != 1 || campaign.lineage) return;
  campaign_map.Problem("inference",
                       "replicates is 1, but one run shows no scatter; allowed: 0 (not measured) "
                       "or 2 to 1000");
}

void CheckBudget(const MapReader& campaign_map, const Campaign& campaign) {
  if (!campaign.budget.model_evaluations || RunsRowsOnly(campaign)) return;
  const auto fitted = std::count_if(campaign.experiments.begin(), campaign.experiments.end(),
                                    [](const Experiment& e) { return e.role == Role::kCalibrate; });
  const std::int64_t first =
      static_cast<std::int64_t>(campaign.method->FirstBatch(campaign)) * fitted;
  if (*campaign.budget.model_evaluations >= first) return;
  campaign_map.Problem("budget",
                       absl::StrCat("model_evaluations is ", *campaign.budget.model_evaluations,
                                    ", but the first iteration takes ", first, " (",
                                    campaign.method->FirstBatch(campaign), " samples, ", fitted,
                                    fitted == 1 ? " fitted test" : " fitted tests", "); allow more",
                                    campaign.method->FirstBatch(campaign) == campaign.samples
                                        ? ", or lower inference.samples"
                                        : ""));
}

}  // namespace calib::campaign
