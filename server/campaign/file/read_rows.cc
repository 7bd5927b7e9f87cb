#include "server/campaign/file/read_rows.h"

#include <algorithm>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "dem/registry/declared_effects.h"
#include "server/campaign/file/text/quantity.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/model/excitation.h"
#include "server/campaign/model/race.h"

namespace calib::campaign {
namespace {

// One row: a value for every parameter, and the sample it is to be like.
void ReadRow(const YamlNode& node, const std::string& path, Eigen::Index row, Campaign& campaign,
             ProblemList& problems) {
  MapReader map(node, path, SectionOf("row"), problems);
  campaign.table->like.push_back(static_cast<int>(map.Integer("like").value_or(row)));
  for (std::size_t j = 0; j < campaign.parameters.size(); ++j) {
    const CalibratedParameter& parameter = campaign.parameters[j];
    // Without spread and scores every experiment has the common value.
    const bool given =
        parameter.of_population
            ? map.Has(parameter.name)
            : map.Require(parameter.name, "every row gives every parameter") != nullptr;
    const auto value = given ? map.Quantity(parameter.name, parameter.unit, {}) : std::nullopt;
    campaign.table->parameters(row, static_cast<Eigen::Index>(j)) = value.value_or(0);
  }
  map.Finish();
}

std::vector<double> ValuesOfRow(const Campaign& campaign, Eigen::Index row) {
  const Eigen::VectorXd values = campaign.table->parameters.row(row);
  return {values.begin(), values.end()};
}

// What a run beside the samples cannot be: it is emulated in coordinates of the prior.
void CheckWithinPrior(const MapReader& inference, const Campaign& campaign, Eigen::Index row) {
  for (std::size_t j = 0; j < campaign.parameters.size(); ++j) {
    const CalibratedParameter& parameter = campaign.parameters[j];
    const double value = campaign.table->parameters(row, static_cast<Eigen::Index>(j));
    if (parameter.prior.InSupport(value)) continue;
    inference.Problem("rows", absl::StrCat("[", row, "]: ", parameter.name, " = ", value,
                                           " lies outside the prior of the parameter"));
    return;
  }
  const inference::JointPrior prior = Priors(campaign);
  if (prior.is_constrained() &&
      !prior.MeetsConstraints(campaign.table->parameters.row(row).transpose())) {
    inference.Problem("rows", absl::StrCat("[", row, "] does not meet the constraints"));
  }
}

// Twice the same run would be taken for a repeat, which shows no scatter.
void CheckDiffer(const MapReader& inference, const Table& table) {
  std::map<std::vector<double>, Eigen::Index> first;
  for (Eigen::Index row = 0; row < table.parameters.rows(); ++row) {
    const Eigen::VectorXd values = table.parameters.row(row);
    std::vector<double> run(values.begin(), values.end());
    run.push_back(table.like[static_cast<std::size_t>(row)]);
    const auto [same, is_new] = first.emplace(std::move(run), row);
    if (is_new) continue;
    inference.Problem("rows", absl::StrCat("[", row, "] is [", same->second,
                                           "] once more: the same run; another `like` is a run "
                                           "on another packing"));
  }
}

// Of a name in the race, why it cannot stand there, in a clause; empty: it can.
std::string WhyNotInRace(const Campaign& campaign, const std::string& name) {
  const auto& declared = campaign.model.user_effects;
  if (dem::FindEffect(declared, name) == nullptr) {
    std::vector<std::string> offered;
    for (const dem::EffectInfo* info : dem::AllEffects(declared)) offered.push_back(info->name);
    return absl::StrCat(Quoted(name), " is not an effect of this build; ",
                        Suggestion(name, offered));
  }
  const auto has = [&name](const std::vector<std::string>& names) {
    return std::find(names.begin(), names.end(), name) != names.end();
  };
  if (has(campaign.model.effects))
    return absl::StrCat(name, " is in model.effects: every run has it");
  if (has(campaign.race)) return absl::StrCat(name, " is named twice");
  // Without a contact that is a problem of its own.
  return campaign.model.contact.empty() ? "" : WhyNotTogether(campaign, {name});
}

}  // namespace

void ReadRace(MapReader& inference, Campaign& campaign) {
  const auto names = inference.TextList("race");
  if (dem::FindEffect(campaign.model.user_effects, kNumerics) != nullptr) {
    inference.Problem("method",
                      absl::StrCat("design calls its changes of the numerics ", kNumerics,
                                   ", as an effect of model.user_effects; call that another"));
  }
  if (!names) return;
  for (const std::string& name : *names) {
    const std::string why = WhyNotInRace(campaign, name);
    if (why.empty()) {
      campaign.race.push_back(name);
    } else {
      inference.Problem("race", why);
    }
  }
}

void ReadRows(MapReader& inference, Campaign& campaign) {
  const bool is_design = RunsAreAdded(campaign);
  const bool is_table = campaign.method->chosen_by() == ChosenBy::kFile;
  const bool beside = !is_design && !is_table;
  if (beside && campaign.precomputed) {
    if (inference.Has("rows"))
      inference.Problem("rows", "are runs to be made; these exist already");
    return;
  }
  const YamlNode* rows =
      is_table ? inference.Require("rows", "the parameter values to run, a list of maps")
               : inference.Find("rows");
  if (rows == nullptr) return;
  if (rows->kind != YamlNode::Kind::kSequence || rows->items.empty()) {
    inference.Problem("rows", "has to be a list of maps, one per run");
    return;
  }
  if (is_design && rows->items.size() > kMostRowsOfBatch) {
    inference.Problem("rows", absl::StrCat("has ", rows->items.size(), " rows; a design takes ",
                                           kMostRowsOfBatch, " at a time"));
    return;
  }
  if (is_table) campaign.samples = static_cast<int>(rows->items.size());
  campaign.table.emplace();
  campaign.table->parameters.setZero(static_cast<Eigen::Index>(rows->items.size()),
                                     static_cast<Eigen::Index>(campaign.parameters.size()));
  const std::size_t before = inference.problems().size();
  for (std::size_t i = 0; i < rows->items.size(); ++i) {
    ReadRow(rows->items[i], absl::StrCat(inference.PathOf("rows"), "[", i, "]"),
            static_cast<Eigen::Index>(i), campaign, inference.problems());
    if (beside && inference.problems().size() == before)
      CheckWithinPrior(inference, campaign, static_cast<Eigen::Index>(i));
  }
  if (beside) CheckDiffer(inference, *campaign.table);
}

void CheckDesign(const MapReader& campaign_map, const Campaign& campaign) {
  for (const std::string& effect : campaign.race) {
    if (StrengthsOf(campaign, effect).empty()) {
      std::vector<std::string> strengths;
      for (const dem::StrengthRay& ray :
           dem::FindEffect(campaign.model.user_effects, effect)->rays) {
        strengths.push_back(absl::StrCat(effect, ".", ray.parameter));
      }
      campaign_map.Problem("inference",
                           absl::StrCat("race: ", effect, " needs a strength among the ",
                                        "parameters: ", absl::StrJoin(strengths, " or ")));
    } else if (std::string why = WhyNotTogether(campaign, {effect}); !why.empty()) {
      campaign_map.Problem("inference", absl::StrCat("race: ", why));
    }
  }
  const bool at_rest =
      std::any_of(campaign.experiments.begin(), campaign.experiments.end(), ReadAtRest);
  for (const CalibratedParameter& parameter : campaign.parameters) {
    if (!campaign.program && !at_rest && IsNumerics(campaign, parameter.name)) {
      campaign_map.Problem("parameters", absl::StrCat(parameter.name, " changes nothing: no test ",
                                                      "is walked in stages"));
    }
  }
  const Eigen::Index rows = campaign.table ? campaign.table->parameters.rows() : Eigen::Index{0};
  for (Eigen::Index row = 0; row < rows; ++row) {
    if (std::string why = WhyNotRun(campaign, ValuesOfRow(campaign, row)); !why.empty()) {
      campaign_map.Problem("inference", absl::StrCat("rows[", row, "]: ", why));
    }
  }
}

}  // namespace calib::campaign
