#include "server/campaign/file/derive.h"

#include <algorithm>
#include <cctype>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "server/campaign/file/read_population.h"
#include "server/campaign/file/text/quantity.h"
#include "server/campaign/file/text/yaml_text.h"

namespace calib::campaign {
namespace {

using Kind = YamlNode::Kind;

void ChangeModel(const Derivation& derivation, YamlNode& root) {
  YamlNode& model = YamlAt(root, "model");
  if (YamlFind(model, "precomputed") != nullptr) {
    // Of tables of runs: what is declared there acts from now on.
    YamlNode& declared = YamlAt(YamlAt(model, "precomputed"), "effects");
    for (const std::string& effect : derivation.effects)
      YamlAt(YamlAt(declared, effect), "acts") = YamlScalar("true");
  } else if (YamlFind(model, "command") != nullptr) {
    for (const std::string& effect : derivation.effects)
      YamlAt(YamlAt(YamlAt(model, "effects"), effect), "acts") = YamlScalar("true");
  } else if (!derivation.effects.empty()) {
    std::vector<YamlNode> effects;
    if (const YamlNode* given = YamlFind(model, "effects"); given != nullptr) {
      if (given->kind == Kind::kSequence) effects = given->items;
      if (given->kind == Kind::kScalar && given->scalar != "none") effects = {*given};
    }
    for (const std::string& effect : derivation.effects) effects.push_back(YamlScalar(effect));
    YamlAt(model, "effects") = YamlList(std::move(effects));
  }
  YamlNode& parameters = YamlAt(root, "parameters");
  for (const auto& [name, prior] : derivation.parameters) {
    YamlAt(parameters, name) = YamlMap({{"prior", YamlScalar(prior.kind)},
                                        {"min", YamlNumber(prior.min)},
                                        {"max", YamlNumber(prior.max)}});
  }
}

bool IsHeldOut(const YamlNode& experiment) {
  const YamlNode* role = YamlFind(experiment, "role");
  return role != nullptr && ValueOf(kRoleWords, role->scalar) == Role::kValidate;
}

void ChangeExperiments(const Derivation& derivation, YamlNode& root) {
  YamlNode& experiments = YamlAt(root, "experiments");
  if (!derivation.experiments.empty()) experiments = YamlList(derivation.experiments);
  if (!derivation.held_out) std::erase_if(experiments.items, IsHeldOut);
}

YamlNode Rows(const Derivation& derivation) {
  std::vector<YamlNode> rows;
  for (const Derivation::Row& row : derivation.rows) {
    YamlNode node = YamlMap({{"like", YamlScalar(absl::StrCat(row.like))}});
    for (const auto& [name, value] : row.values) YamlAt(node, name) = YamlNumber(value);
    rows.push_back(std::move(node));
  }
  return YamlList(std::move(rows));
}

// The runs that a method asks for may grow with the parameters.
void RaiseRuns(const MethodList& methods, YamlNode& root) {
  YamlNode& inference = YamlAt(root, "inference");
  const YamlNode* method = YamlFind(inference, "method");
  const auto named = method != nullptr ? methods.Find(method->scalar) : methods.standard();
  if (named == nullptr) return;
  const auto said = [&inference](const std::string& key) -> std::optional<int> {
    const YamlNode* node = YamlFind(inference, key);
    int number = 0;
    if (node == nullptr || !absl::SimpleAtoi(node->scalar, &number)) return std::nullopt;
    return number;
  };
  const LeastRuns runs = named->least_runs(YamlAt(root, "parameters").entries.size(), said);
  const bool is_word = YamlFind(inference, runs.key) != nullptr && !said(runs.key);
  if (is_word || said(runs.key).value_or(runs.standard) >= runs.least) return;
  YamlAt(inference, runs.key) = YamlScalar(absl::StrCat(runs.least));
}

// Runs that infer nothing may be of other observables than the groups name.
void DropNoiseGroups(YamlNode& root) {
  const YamlNode* noise = YamlFind(root, "noise");
  if (noise == nullptr || noise->kind != Kind::kMap) return;
  const bool inferred = YamlFind(*noise, "inferred") != nullptr;
  if (inferred) YamlAt(root, "noise") = YamlScalar("inferred");
  if (!inferred && YamlFind(*noise, "model_error") != nullptr) YamlErase(root, "noise");
}

void ChangeInference(const MethodList& methods, const Derivation& derivation, YamlNode& root) {
  if (derivation.race || (!derivation.rows.empty() && !derivation.method)) {
    YamlNode inference = YamlMap(
        {{"method",
          YamlScalar(std::string(
              methods.Of(derivation.race ? ChosenBy::kRequest : ChosenBy::kFile)->name()))}});
    if (derivation.race) {
      std::vector<YamlNode> race;
      for (const std::string& effect : *derivation.race) race.push_back(YamlScalar(effect));
      YamlAt(inference, "race") = YamlList(std::move(race));
    }
    if (!derivation.rows.empty()) YamlAt(inference, "rows") = Rows(derivation);
    YamlAt(root, "inference") = std::move(inference);
    YamlErase(root, "early_stopping");
    YamlErase(root, "budget");
    DropNoiseGroups(root);
    return;
  }
  YamlNode& inference = YamlAt(root, "inference");
  if (derivation.method) {
    YamlAt(inference, "method") = YamlScalar(*derivation.method);
    YamlErase(inference, "freeze");  // it speaks of the parent's iterations
  }
  if (derivation.samples) {
    YamlAt(inference, "samples") = YamlScalar(absl::StrCat(*derivation.samples));
  }
  if (!derivation.rows.empty()) {
    YamlAt(inference, "rows") = Rows(derivation);
  } else if (!derivation.parameters.empty()) {
    YamlErase(inference, "rows");  // the parent's lack these
  }
  if (!derivation.parameters.empty()) RaiseRuns(methods, root);
  if (derivation.max_iterations) {
    YamlAt(inference, "max_iterations") = YamlScalar(absl::StrCat(*derivation.max_iterations));
  }
  if (derivation.model_evaluations) {
    YamlAt(YamlAt(root, "budget"), "model_evaluations") =
        YamlScalar(absl::StrCat(*derivation.model_evaluations));
  }
  if (!derivation.first_proposal) return;
  YamlNode proposal =
      YamlMap({{"prior_share", YamlNumber(derivation.first_proposal->prior_share)}});
  for (const auto& [name, place] : derivation.first_proposal->places) {
    YamlAt(proposal, name) =
        YamlMap({{"center", YamlNumber(place.center)}, {"sd", YamlNumber(place.sd)}});
  }
  YamlAt(inference, "first_proposal") = std::move(proposal);
}

}  // namespace

absl::StatusOr<std::string> Derive(const MethodList& methods, const std::string& parent_yaml,
                                   const Derivation& derivation) {
  YamlParse parse = ParseYaml(parent_yaml);
  if (parse.error || parse.root->kind != Kind::kMap) {
    return absl::InvalidArgumentError("the campaign it is derived from is not a YAML map");
  }
  YamlNode& root = *parse.root;
  YamlAt(root, "name") = YamlScalar(derivation.name);
  YamlAt(root, "lineage") = YamlMap({{"parent", YamlScalar(derivation.lineage.parent)},
                                     {"purpose", YamlScalar(derivation.lineage.purpose)}});
  ChangeModel(derivation, root);
  StateLabels(root);
  ChangeExperiments(derivation, root);
  if (derivation.new_labels) AddLabels(root);
  ChangeInference(methods, derivation, root);
  // Strengths are tried up to where the model breaks: what diverges there is an answer, no fault.
  YamlAt(YamlAt(root, "failure"), "pause_above") = YamlScalar("1");
  return ToYaml(root);
}

}  // namespace calib::campaign
