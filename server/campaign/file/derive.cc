#include "server/campaign/file/derive.h"

#include <algorithm>
#include <cctype>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "server/campaign/file/text/quantity.h"
#include "server/campaign/file/text/yaml_text.h"

namespace calib::campaign {
namespace {

using Kind = YamlNode::Kind;

// What ties a parameter to others goes with it: entries of the lists that name it.
void Untie(const std::string& name, YamlNode& root) {
  const auto names = [&name](const YamlNode& item) {
    for (const YamlNode& part : item.items) {
      if (part.scalar == name) return true;
    }
    // In the text of a constraint, as a whole word.
    for (std::size_t at = item.scalar.find(name); at != std::string::npos;
         at = item.scalar.find(name, at + 1)) {
      const auto part_of_name = [&item](std::size_t i) {
        return i < item.scalar.size() &&
               (std::isalnum(static_cast<unsigned char>(item.scalar[i])) != 0 ||
                item.scalar[i] == '_' || item.scalar[i] == '.');
      };
      if (!part_of_name(at - 1) && !part_of_name(at + name.size())) return true;
    }
    return false;
  };
  for (const char* key : {"prior_correlation", "constraints"}) {
    if (YamlFind(root, key) == nullptr) continue;
    YamlNode& list = YamlAt(root, key);
    if (list.kind == Kind::kScalar ? names(list)
                                   : (std::erase_if(list.items, names), list.items.empty())) {
      YamlErase(root, key);
    }
  }
}

void ChangeModel(const Derivation& derivation, YamlNode& root) {
  YamlNode& model = YamlAt(root, "model");
  if (!derivation.effects.empty()) {
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
  for (const auto& [name, value] : derivation.fixed) {
    YamlErase(parameters, name);
    Untie(name, root);
    YamlAt(YamlAt(model, "fixed"), name) = YamlNumber(value);
  }
}

bool IsHeldOut(const YamlNode& experiment) {
  const YamlNode* role = YamlFind(experiment, "role");
  return role != nullptr && ValueOf(kRoleWords, role->scalar) == Role::kValidate;
}

// out: an entry of `experiments`.
void SetStaging(const dem::Staging& staging, YamlNode& out) {
  YamlNode& node = YamlAt(out, "staging");
  if (staging.rate) YamlAt(node, "rate") = YamlNumber(*staging.rate);
  if (staging.step) YamlAt(node, "step") = YamlNumber(*staging.step);
  if (staging.damping_loading && staging.damping_settling) {
    YamlAt(node, "damping") =
        YamlList({YamlNumber(*staging.damping_loading), YamlNumber(*staging.damping_settling)});
  }
}

void ChangeExperiments(const Derivation& derivation, YamlNode& root) {
  YamlNode& experiments = YamlAt(root, "experiments");
  if (!derivation.experiments.empty()) experiments = YamlList(derivation.experiments);
  if (!derivation.held_out) std::erase_if(experiments.items, IsHeldOut);
  for (YamlNode& experiment : experiments.items) {
    const YamlNode* name = YamlFind(experiment, "name");
    if (name == nullptr) continue;
    const auto staging = derivation.staging.find(name->scalar);
    if (staging != derivation.staging.end()) SetStaging(staging->second, experiment);
  }
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

// A batch of runs about a place is no calibration: what steers the parent's would refuse it, or not
// look at that place.
void MakeBatch(YamlNode& root) {
  YamlNode batch = YamlMap({{"method", YamlScalar("iterative_bayesian_filter")}});
  if (const YamlNode* parent = YamlFind(root, "inference"); parent != nullptr) {
    if (const YamlNode* design = YamlFind(*parent, "design"); design != nullptr) {
      YamlAt(batch, "design") = *design;
    }
  }
  YamlAt(root, "inference") = std::move(batch);
  YamlErase(root, "early_stopping");
}

// The samples that surrogate_msrs starts from grow with the parameters.
void RaiseSamples(YamlNode& root) {
  YamlNode& inference = YamlAt(root, "inference");
  const YamlNode* method = YamlFind(inference, "method");
  const YamlNode* samples = YamlFind(inference, "samples");
  int given = 0;
  if (method == nullptr || ValueOf(kMethodWords, method->scalar) != Method::kSurrogateMsrs ||
      samples == nullptr || !absl::SimpleAtoi(samples->scalar, &given)) {
    return;
  }
  const int fewest = 2 * static_cast<int>(YamlAt(root, "parameters").entries.size()) + 1;
  if (given < fewest) YamlAt(inference, "samples") = YamlScalar(absl::StrCat(fewest));
}

void ChangeInference(const Derivation& derivation, YamlNode& root) {
  if (derivation.race || !derivation.rows.empty()) {
    YamlNode inference = YamlMap(
        {{"method", YamlScalar(ToString(derivation.race ? Method::kDesign : Method::kTable))}});
    if (derivation.race) {
      std::vector<YamlNode> race;
      for (const std::string& effect : *derivation.race) race.push_back(YamlScalar(effect));
      YamlAt(inference, "race") = YamlList(std::move(race));
    }
    if (!derivation.rows.empty()) YamlAt(inference, "rows") = Rows(derivation);
    YamlAt(root, "inference") = std::move(inference);
    YamlErase(root, "early_stopping");
    YamlErase(root, "budget");
    return;
  }
  if (ToDerivedFor(derivation.lineage.purpose) == DerivedFor::kWarmFit) MakeBatch(root);
  YamlNode& inference = YamlAt(root, "inference");
  if (derivation.samples) {
    YamlAt(inference, "samples") = YamlScalar(absl::StrCat(*derivation.samples));
  }
  if (!derivation.parameters.empty()) RaiseSamples(root);
  if (derivation.max_iterations) {
    YamlAt(inference, "max_iterations") = YamlScalar(absl::StrCat(*derivation.max_iterations));
  }
  if (derivation.replicates) {
    YamlAt(inference, "replicates") = YamlScalar(absl::StrCat(*derivation.replicates));
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

absl::StatusOr<std::string> Derive(const std::string& parent_yaml, const Derivation& derivation) {
  YamlParse parse = ParseYaml(parent_yaml);
  if (parse.error || parse.root->kind != Kind::kMap) {
    return absl::InvalidArgumentError("the campaign it is derived from is not a YAML map");
  }
  YamlNode& root = *parse.root;
  YamlAt(root, "name") = YamlScalar(derivation.name);
  YamlAt(root, "lineage") = YamlMap({{"parent", YamlScalar(derivation.lineage.parent)},
                                     {"purpose", YamlScalar(derivation.lineage.purpose)}});
  ChangeModel(derivation, root);
  ChangeExperiments(derivation, root);
  ChangeInference(derivation, root);
  // Strengths are tried up to where the model breaks: what diverges there is an answer, no fault.
  YamlAt(YamlAt(root, "failure"), "pause_above") = YamlScalar("1");
  return ToYaml(root);
}

}  // namespace calib::campaign
