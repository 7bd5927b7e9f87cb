#include "server/campaign/file/read_inference.h"

#include <algorithm>
#include <array>
#include <set>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
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

constexpr int kMostStages = 100;  // of tmcmc, unless max_iterations says otherwise

void ReadMethod(MapReader& map, Campaign& campaign) {
  campaign.method = map.Choice("method", kMethodWords).value_or(campaign.method);
  if (campaign.method == Method::kTmcmc) campaign.max_iterations = kMostStages;
  if (IsFilter(campaign.method) || campaign.method == Method::kTable) return;
  if (campaign.method == Method::kDesign) {
    if (campaign.precomputed) {
      map.Problem("method",
                  "design is for runs still to be made; those that exist already are "
                  "what they are: use sqmc");
    }
    return;
  }
  if (campaign.precomputed) {
    map.Problem("method", absl::StrCat(ToString(campaign.method),
                                       " chooses its own samples, and runs that exist "
                                       "already are what they are; use sqmc"));
  } else if (campaign.filter.noise == NoiseMode::kEssTarget) {
    map.Problem("method", absl::StrCat(ToString(campaign.method),
                                       " needs the errors of the readings; use noise: "
                                       "given or noise: inferred with it"));
  }
}

void ReadDesign(MapReader& map, inference::FilterOptions& filter) {
  filter.design = map.Choice("design", kDesignWords).value_or(filter.design);
}

void ReadTmcmcOptions(MapReader& map, inference::TmcmcOptions& tmcmc) {
  tmcmc.steps = static_cast<int>(map.Integer("steps").value_or(tmcmc.steps));
  tmcmc.target_cv = map.Quantity("target_cv").value_or(tmcmc.target_cv);
}

void ReadTermination(MapReader& map, Campaign& campaign) {
  const YamlNode* node = map.Find("termination");
  if (node == nullptr) return;
  if (node->kind == YamlNode::Kind::kScalar && node->scalar == "off") {
    campaign.termination.reset();
    return;
  }
  campaign.termination = map.Quantity("termination");
}

void ReadDecisions(MapReader& map, Campaign& campaign) {
  if (map.Choice("decisions", kDecisionsWords) != Decisions::kImmediate) return;
  if (campaign.method != Method::kSurrogateMsrs && !IsFilter(campaign.method)) {
    map.Problem("decisions", absl::StrCat(ToString(campaign.method),
                                          " decides nothing while runs are under way; immediate "
                                          "is for surrogate_msrs, and for sqmc and "
                                          "iterative_bayesian_filter with early_stopping"));
    return;
  }
  campaign.decisions = Decisions::kImmediate;
}

void ReadFilterOptions(MapReader& map, Campaign& campaign) {
  inference::FilterOptions& filter = campaign.filter;
  filter.tolerance = map.Quantity("tolerance").value_or(filter.tolerance);
  filter.defensive_share = map.Quantity("defensive_share").value_or(filter.defensive_share);
  filter.max_components =
      static_cast<int>(map.Integer("max_components").value_or(filter.max_components));
  filter.concentration = map.Quantity("concentration").value_or(filter.concentration);
  filter.mixture = map.Choice("mixture", kMixtureWords).value_or(filter.mixture);
  ReadDesign(map, filter);
  filter.reversed_path = map.TrueOrFalse("reversed_path").value_or(filter.reversed_path);
  if (campaign.filter.noise != NoiseMode::kEssTarget) {
    filter.ess_target = map.Quantity("ess_target").value_or(filter.ess_target);
  } else if (map.Has("ess_target")) {
    map.Ignore({"ess_target"});
    map.Problem("ess_target", "is given by noise: {ess_target: ...} already; remove it here");
  }
}

// freeze: {2: [young_modulus], 3: converged}; the names are looked at once the parameters are
// known.
void ReadFreeze(MapReader& inference, Campaign& campaign) {
  inference.Ignore({"freeze"});
  if (!inference.Has("freeze")) return;
  if (campaign.method != Method::kIterativeBayesianFilter || campaign.precomputed) {
    inference.Problem("freeze",
                      "belongs to method: iterative_bayesian_filter with runs still to be made");
    return;
  }
  auto map = inference.Map("freeze");
  if (!map) return;
  for (const std::string& key : map->Keys()) {
    int iteration = 0;
    if (!absl::SimpleAtoi(key, &iteration) || iteration < 1 ||
        iteration >= campaign.max_iterations) {
      map->Ignore({key});
      map->Problem(key, absl::StrCat("is no iteration after the first; allowed: 1 to ",
                                     campaign.max_iterations - 1, " (the first is 0)"));
      continue;
    }
    Freeze freeze;
    const auto names = map->TextList(key);
    if (!names) continue;
    freeze.converged = *names == std::vector<std::string>{"converged"};
    if (!freeze.converged) freeze.names = *names;
    campaign.freeze[iteration] = std::move(freeze);
  }
  map->Finish();
}

// Keys that this method does not read.
void RefuseKeysOfOthers(MapReader& map, Method method) {
  const auto refuse = [&map](const std::vector<std::string>& keys, const std::string& owner) {
    map.Ignore(keys);
    for (const std::string& key : keys) {
      if (map.Has(key)) map.Problem(key, "belongs to " + owner + "; remove it");
    }
  };
  if (!IsFilter(method)) {
    refuse({"tolerance", "ess_target", "design", "defensive_share", "max_components",
            "concentration", "mixture", "reversed_path"},
           "method: iterative_bayesian_filter and sqmc");
  }
  if (method != Method::kSurrogateMsrs) {
    refuse({"surrogate", "termination", "in_flight"}, "method: surrogate_msrs");
  }
  if (method != Method::kTmcmc) refuse({"steps", "target_cv"}, "method: tmcmc");
  if (method == Method::kDesign) {
    refuse({"samples", "max_iterations", "replicates", "first_proposal"},
           "methods that choose their samples");
  } else {
    refuse({"race"}, "method: design");
  }
}

void ReadMethodSection(MapReader& campaign_map, Campaign& campaign) {
  auto map = campaign_map.Map("inference");
  if (map) {
    ReadMethod(*map, campaign);
    if (campaign.method == Method::kDesign) {
      campaign.samples = kMostRowsOfBatch;
      campaign.max_iterations = 1;
      ReadRace(*map, campaign);
      ReadFreeze(*map, campaign);
      ReadDecisions(*map, campaign);
      RefuseKeysOfOthers(*map, campaign.method);
      map->Ignore({"rows"});  // read once the parameters are known
      map->Finish();
      return;
    }
    const int fewest = campaign.method == Method::kTmcmc ? kFewestChains : 2;
    campaign.samples =
        static_cast<int>(map->Integer("samples", fewest, kMostSamples).value_or(campaign.samples));
    campaign.max_iterations =
        static_cast<int>(map->Integer("max_iterations").value_or(campaign.max_iterations));
    if (IsFilter(campaign.method)) ReadFilterOptions(*map, campaign);
    if (const auto replicates = map->Integer("replicates")) {
      campaign.replicates = static_cast<int>(*replicates);
    }
    ReadFreeze(*map, campaign);
    if (campaign.method == Method::kSurrogateMsrs) {
      campaign.surrogate =
          map->Choice("surrogate", kSurrogateModelWords).value_or(campaign.surrogate);
      ReadTermination(*map, campaign);
      campaign.in_flight = static_cast<int>(map->Integer("in_flight").value_or(campaign.in_flight));
    }
    ReadDecisions(*map, campaign);
    if (campaign.method == Method::kTmcmc) ReadTmcmcOptions(*map, campaign.tmcmc);
    RefuseKeysOfOthers(*map, campaign.method);
    map->Ignore({"rows", "first_proposal"});  // read once the parameters are known
    if (campaign.method == Method::kSqmc && map->Has("max_iterations") &&
        campaign.max_iterations != 1) {
      map->Problem(
          "max_iterations",
          "has to be 1 with sqmc, which has one iteration; use iterative_bayesian_filter for more");
    }
    map->Finish();
  }
  if (campaign.method == Method::kSqmc || campaign.method == Method::kTable)
    campaign.max_iterations = 1;
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

void ReadEarlyStopping(MapReader& campaign_map, Campaign& campaign) {
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
  if (!stopping.rungs.empty() && !IsFilter(campaign.method)) {
    map->Problem("rungs",
                 "is for sqmc and iterative_bayesian_filter; chains and optimisers judge each run "
                 "on its own");
  } else if (!stopping.rungs.empty() && campaign.decisions == Decisions::kImmediate) {
    map->Problem("rungs",
                 "makes samples wait for each other, which inference.decisions: immediate does "
                 "not; remove one of the two");
  }
  map->Finish();
  if (campaign.method == Method::kDesign && !off) {
    campaign_map.Problem("early_stopping",
                         "is for campaigns that infer; the runs of a design go to their ends");
    return;
  }
  // A tempered likelihood has no bound that could be kept, and runs that exist already have nothing
  // to stop; the surrogate would take a bound for a value.
  if (!off && campaign.filter.noise != NoiseMode::kEssTarget && !campaign.precomputed &&
      campaign.method != Method::kSurrogateMsrs) {
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
  if (campaign.method == Method::kDesign) {
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

void CheckFreeze(MapReader& inference, const Campaign& campaign) {
  if (!campaign.freeze.empty() && !campaign.populations.empty()) {
    inference.Problem("freeze",
                      absl::StrCat("does not go with parameters per experiment or batch (",
                                   campaign.populations.front().name,
                                   "), whose parts are not independent of each other"));
    return;
  }
  std::set<std::string> held;
  for (const auto& [iteration, freeze] : campaign.freeze) {
    for (const std::string& name : freeze.names) {
      const auto is_it = [&name](const CalibratedParameter& p) { return p.name == name; };
      if (std::none_of(campaign.parameters.begin(), campaign.parameters.end(), is_it)) {
        inference.Problem("freeze", absl::StrCat("'", name,
                                                 "' is not calibrated here; write names "
                                                 "of parameters, or converged alone"));
      }
      held.insert(name);
    }
  }
  if (!held.empty() && held.size() >= campaign.parameters.size()) {
    inference.Problem("freeze", "holds every parameter; leave at least one to be inferred");
  }
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

void ReadStart(MapReader& campaign_map, Campaign& campaign) {
  ReadLineage(campaign_map, campaign);
  if (!campaign_map.Has("inference")) return;
  auto map = campaign_map.Map("inference");
  if (!map) return;
  ReadRows(*map, campaign);
  CheckFreeze(*map, campaign);
  if (campaign.method != Method::kDesign) ReadFirstProposal(*map, campaign);
}

void ReadInference(MapReader& campaign_map, Campaign& campaign) {
  ReadNoiseMode(campaign_map, campaign.filter);
  ReadMethodSection(campaign_map, campaign);
  ReadEarlyStopping(campaign_map, campaign);
  ReadFailure(campaign_map, campaign);
  ReadBudget(campaign_map, campaign);
  campaign.seed = campaign_map.Seed("seed").value_or(campaign.seed);
  campaign.filter.seed = campaign.seed;
}

void CheckSamples(MapReader& campaign_map, const Campaign& campaign) {
  const std::size_t fewest = 2 * campaign.parameters.size() + 1;
  if (campaign.method == Method::kSurrogateMsrs &&
      static_cast<std::size_t>(campaign.samples) < fewest) {
    campaign_map.Problem("inference", absl::StrCat("samples is ", campaign.samples,
                                                   "; surrogate_msrs starts from "
                                                   "at least ",
                                                   fewest, " for ", campaign.parameters.size(),
                                                   " parameters (two each and one)"));
  }
}

void CheckReplicates(const MapReader& campaign_map, const Campaign& campaign) {
  if (campaign.replicates != 1 || campaign.lineage) return;
  campaign_map.Problem("inference",
                       "replicates is 1, but one run shows no scatter; allowed: 0 (not measured) "
                       "or 2 to 1000");
}

void CheckBudget(const MapReader& campaign_map, const Campaign& campaign) {
  if (!campaign.budget.model_evaluations || RunsRowsOnly(campaign.method)) return;
  const auto fitted = std::count_if(campaign.experiments.begin(), campaign.experiments.end(),
                                    [](const Experiment& e) { return e.role == Role::kCalibrate; });
  const std::int64_t first = static_cast<std::int64_t>(campaign.samples) * fitted;
  if (*campaign.budget.model_evaluations >= first) return;
  campaign_map.Problem(
      "budget", absl::StrCat("model_evaluations is ", *campaign.budget.model_evaluations,
                             ", but the first iteration takes ", first, " (", campaign.samples,
                             " samples, ", fitted, fitted == 1 ? " fitted test" : " fitted tests",
                             "); allow more, or lower inference.samples"));
}

}  // namespace calib::campaign
