#include "server/campaign/file/read_population.h"

#include <algorithm>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "server/campaign/file/parameters/setting_names.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/file/text/yaml_text.h"
#include "server/campaign/model/race.h"

namespace calib::campaign {
namespace {

constexpr const char* kLabels = "labels";
constexpr const char* kUnseen = "unseen";

const std::string& LabelOf(Per per, const ExperimentOutline& outline) {
  return per == Per::kExperiment ? outline.name : outline.batch;
}

bool HasSetting(const std::optional<SettingOf>& setting, const ExperimentOutline& outline) {
  return !setting || std::find(setting->experiments.begin(), setting->experiments.end(),
                               outline.name) != setting->experiments.end();
}

bool IsAmong(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// Why a parameter cannot have a value for each label, a sentence's rest; empty: it can.
std::string WhyOneValue(const CalibratedParameter& common, const MapReader& parameters,
                        const Campaign& campaign) {
  const std::string& name = common.name;
  if (common.setting && !common.setting->number.empty() && common.setting->number != name) {
    return absl::StrCat("is a number of one experiment and has one value; leave per out, or call ",
                        "it ", common.setting->number, ", that of all experiments");
  }
  if (NullOf(campaign, name)) {
    return "is of an effect or the numerics that each run of a design has or lacks, and cannot "
           "differ between experiments";
  }
  if (parameters.Has(SpreadName(name))) {
    return absl::StrCat("has a spread called ", SpreadName(name),
                        ", as another parameter is; call that another");
  }
  return "";
}

// One for each experiment that lacks a batch, or has a label that no name can be made of.
void CheckLabels(Per per, const CalibratedParameter& common,
                 const std::vector<ExperimentOutline>& outlines, ProblemList& problems) {
  for (std::size_t i = 0; i < outlines.size(); ++i) {
    const ExperimentOutline& outline = outlines[i];
    if (!HasSetting(common.setting, outline)) continue;
    const std::string& label = LabelOf(per, outline);
    const char* key = per == Per::kExperiment ? ".name" : ".batch";
    const std::string path = absl::StrCat("experiments[", i + 1, "]", key);
    if (label.empty() && per == Per::kBatch) {
      problems.Add(outline.line, path,
                   absl::StrCat("is missing; ", common.name, " has a value for each batch"));
    } else if (absl::EndsWith(label, kScoreSuffix)) {
      problems.Add(outline.line, path,
                   absl::StrCat(Quoted(label), " ends in ", kScoreSuffix, ", as names of what ",
                                "decides on ", common.name, " do; call it another"));
    }
  }
}

void Add(const CalibratedParameter& parameter, Campaign& campaign, std::size_t& place) {
  place = campaign.parameters.size();
  campaign.parameters.push_back(parameter);
}

// The map of each parameter with `per`, with what it says.
template <typename Take>
void ForEachPer(YamlNode& file, const Take& take) {
  const YamlNode* parameters = YamlFind(file, "parameters");
  if (parameters == nullptr || parameters->kind != YamlNode::Kind::kMap) return;
  for (YamlEntry& entry : YamlAt(file, "parameters").entries) {
    if (entry.value.kind != YamlNode::Kind::kMap) continue;
    const YamlNode* said = YamlFind(entry.value, "per");
    const auto per = said == nullptr ? std::nullopt : ValueOf(kPerWords, said->scalar);
    if (per) take(entry.key, *per, entry.value);
  }
}

std::vector<std::string> ListedIn(const YamlNode& parameter) {
  std::vector<std::string> labels;
  const YamlNode* listed = YamlFind(parameter, kLabels);
  if (listed == nullptr) return labels;
  if (listed->kind == YamlNode::Kind::kScalar) labels.push_back(listed->scalar);
  for (const YamlNode& item : listed->items) labels.push_back(item.scalar);
  return labels;
}

YamlNode ListOf(const std::vector<std::string>& labels) {
  std::vector<YamlNode> items;
  items.reserve(labels.size());
  for (const std::string& label : labels) items.push_back(YamlScalar(label));
  return YamlList(std::move(items));
}

std::vector<ExperimentOutline> OutlinesIn(const YamlNode& file) {
  return OutlinesOf(YamlFind(file, "experiments"));
}

// The setting that a name means; empty: it is of the model.
std::optional<SettingOf> SettingIn(const YamlNode& file, const std::string& name,
                                   const std::vector<ExperimentOutline>& outlines) {
  const YamlNode* model = YamlFind(file, "model");
  if (model == nullptr || YamlFind(*model, "contact") == nullptr) return std::nullopt;
  return FindSetting(name, outlines).setting;
}

std::string UnseenAmong(const std::vector<std::string>& labels) {
  std::string label = kUnseen;
  for (int k = 2; IsAmong(labels, label); ++k) label = absl::StrCat(kUnseen, "_", k);
  return label;
}

}  // namespace

std::vector<std::string> LabelsOf(Per per, const std::optional<SettingOf>& setting,
                                  const std::vector<ExperimentOutline>& outlines) {
  std::vector<std::string> labels;
  for (const ExperimentOutline& outline : outlines) {
    const std::string& label = LabelOf(per, outline);
    if (label.empty() || !HasSetting(setting, outline) || IsAmong(labels, label)) continue;
    labels.push_back(label);
  }
  return labels;
}

void AddPopulation(const BesidePrior& beside, const std::vector<ExperimentOutline>& outlines,
                   MapReader& parameters, Campaign& campaign) {
  if (!beside.per || !beside.spread) return;
  const CalibratedParameter common = campaign.parameters.back();
  if (std::string why = WhyOneValue(common, parameters, campaign); !why.empty()) {
    parameters.Problem(common.name, why);
    return;
  }
  const std::size_t before = parameters.problems().size();
  CheckLabels(*beside.per, common, outlines, parameters.problems());
  if (parameters.problems().size() > before) return;
  Population population{.name = common.name,
                        .unit = common.unit,
                        .per = *beside.per,
                        .common = campaign.parameters.size() - 1,
                        .labels = LabelsOf(*beside.per, common.setting, outlines),
                        .min = common.prior.min,
                        .max = common.prior.max};
  if (beside.labels) population.labels = *beside.labels;
  Add({.name = SpreadName(common.name),
       .unit = common.unit,
       .prior = *beside.spread,
       .nuisance = common.nuisance,
       .of_population = true},
      campaign, population.spread);
  const inference::Prior standard_normal{.kind = inference::PriorKind::kNormal, .mean = 0, .sd = 1};
  for (const std::string& label : population.labels) {
    Add({.name = ScoreName(common.name, label),
         .unit = "1",
         .prior = standard_normal,
         .nuisance = true,
         .of_population = true},
        campaign, population.scores.emplace_back());
  }
  campaign.populations.push_back(std::move(population));
}

void StateLabels(YamlNode& file) {
  const std::vector<ExperimentOutline> outlines = OutlinesIn(file);
  ForEachPer(file, [&](const std::string& name, Per per, YamlNode& parameter) {
    if (YamlFind(parameter, kLabels) != nullptr) return;
    YamlAt(parameter, kLabels) = ListOf(LabelsOf(per, SettingIn(file, name, outlines), outlines));
  });
}

void AddLabels(YamlNode& file) {
  ForEachPer(file, [&file](const std::string& name, Per per, YamlNode& parameter) {
    std::vector<std::string> labels = ListedIn(parameter);
    const YamlNode* experiments = YamlFind(file, "experiments");
    if (experiments == nullptr) return;
    const std::string unseen = UnseenAmong(labels);
    for (YamlNode& experiment : YamlAt(file, "experiments").items) {
      if (per == Per::kBatch && YamlFind(experiment, "batch") == nullptr) {
        YamlAt(experiment, "batch") = YamlScalar(unseen);
      }
    }
    const std::vector<ExperimentOutline> outlines = OutlinesIn(file);
    for (const std::string& label : LabelsOf(per, SettingIn(file, name, outlines), outlines)) {
      if (!IsAmong(labels, label)) labels.push_back(label);
    }
    YamlAt(parameter, kLabels) = ListOf(labels);
  });
}

}  // namespace calib::campaign
