#include "server/diagnosis/program_plans.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "server/campaign/file/derive.h"
#include "server/campaign/file/text/yaml_text.h"
#include "server/methods/registry.h"

namespace calib::diagnosis {
namespace {

using campaign::YamlNode;
using Json = nlohmann::json;

// As it is read back to the same text.
YamlNode YamlOf(const Json& value) {
  if (value.is_null()) return {};
  if (value.is_string()) return campaign::YamlScalar(value.get<std::string>());
  if (!value.is_array()) return campaign::YamlScalar(value.dump());
  std::vector<YamlNode> items;
  for (const Json& item : value) items.push_back(YamlOf(item));
  return campaign::YamlList(std::move(items));
}

YamlNode Settings(const campaign::ProgramSettings& told) {
  YamlNode settings = campaign::YamlMap();
  for (const auto& [name, value] : told)
    campaign::YamlAt(settings, name) = YamlOf(Json::parse(value));
  return settings;
}

// A list for each setting that they differ by; a number where there are none.
YamlNode Realizations(const std::vector<campaign::Specimen>& specimens) {
  std::map<std::string, std::vector<YamlNode>> lists;
  for (const campaign::Specimen& specimen : specimens) {
    const auto* own = std::get_if<campaign::ProgramSpecimen>(&specimen);
    if (own == nullptr) continue;
    for (const auto& [name, value] : own->settings)
      lists[name].push_back(YamlOf(Json::parse(value)));
  }
  if (lists.empty()) return campaign::YamlScalar(absl::StrCat(specimens.size()));
  YamlNode realizations = campaign::YamlMap();
  for (auto& [name, values] : lists)
    campaign::YamlAt(realizations, name) = campaign::YamlList(std::move(values));
  return realizations;
}

YamlNode Noise(const campaign::MeasuredObservable& observable,
               const campaign::Experiment& experiment) {
  YamlNode noise = campaign::YamlMap();
  const campaign::NoiseLaw law = campaign::LawOf(observable);
  if (law.absolute) {
    campaign::YamlAt(noise, "absolute") = campaign::YamlNumber(*law.absolute);
  } else {
    campaign::YamlAt(noise, "relative") = campaign::YamlNumber(law.relative);
    if (law.floor > 0) campaign::YamlAt(noise, "floor") = campaign::YamlNumber(law.floor);
  }
  const double length = campaign::CorrelationLengthOf(experiment.control, observable);
  if (length > 0) campaign::YamlAt(noise, "correlation_length") = campaign::YamlNumber(length);
  return noise;
}

}  // namespace

YamlNode ProgramEntry(const campaign::Experiment& experiment, const std::string& name,
                      const std::string& file) {
  YamlNode entry = campaign::YamlMap({{"name", campaign::YamlScalar(name)}});
  YamlNode data = campaign::YamlMap({{"file", campaign::YamlScalar(file)}});
  if (!experiment.test.empty()) {
    campaign::YamlAt(entry, "test") = campaign::YamlScalar(experiment.test);
    campaign::YamlAt(data, "strain") = campaign::YamlScalar("logarithmic");
  }
  YamlNode units = campaign::YamlMap();
  const auto add_unit = [&units](const std::string& of, const std::string& unit) {
    if (!of.empty() && unit != "1") campaign::YamlAt(units, of) = campaign::YamlScalar(unit);
  };
  add_unit(experiment.control_name, experiment.control_unit);
  YamlNode observables = campaign::YamlMap();
  for (const campaign::MeasuredObservable& observable : experiment.observables) {
    add_unit(observable.name, observable.unit);
    campaign::YamlAt(campaign::YamlAt(observables, observable.name), "noise") =
        Noise(observable, experiment);
  }
  if (!units.entries.empty()) campaign::YamlAt(data, "units") = std::move(units);
  if (!experiment.told.empty()) campaign::YamlAt(entry, "settings") = Settings(experiment.told);
  campaign::YamlAt(entry, "realizations") = Realizations(experiment.specimens);
  if (experiment.specimen_grains) {
    campaign::YamlAt(entry, "specimen_grains") = campaign::YamlNumber(*experiment.specimen_grains);
  }
  campaign::YamlAt(entry, "data") = std::move(data);
  if (!experiment.control_name.empty()) {
    campaign::YamlAt(entry, "control") = campaign::YamlScalar(experiment.control_name);
  }
  campaign::YamlAt(entry, "observables") = std::move(observables);
  return entry;
}

PlannedExperiment PlanOf(const campaign::Experiment& next) {
  PlannedExperiment planned{
      .test = next.name, .settings = {}, .control = next.control_name, .path = next.control};
  planned.told = next.told;
  planned.of_next = true;
  return planned;
}

std::optional<YamlNode> EntryOfPlan(const report::CampaignView& base, const TestPlan& plan,
                                    const campaign::Experiment& pattern) {
  if (base.campaign.program) return ProgramEntry(pattern, plan.name, plan.file);
  const auto original = EntryNamed(base.source.campaign_file(), base.campaign, pattern.name);
  if (!original) return std::nullopt;
  return EntryFor(plan, pattern, *original, base.campaign);
}

absl::StatusOr<PlanScreen> PlansOfProgram(client::Laboratory& laboratory,
                                          const report::CampaignView& base, int like) {
  const std::vector<campaign::Experiment>& next = base.campaign.next;
  if (next.empty()) return PlanScreen{.why_none = "model.next names no test"};
  campaign::Derivation::Row row{.like = like};
  for (const v1::Sample& sample : base.samples) {
    if (sample.index() != like) continue;
    for (std::size_t j = 0; j < base.campaign.parameters.size(); ++j)
      row.values[base.campaign.parameters[j].name] = sample.parameters(static_cast<int>(j));
  }
  std::vector<YamlNode> entries;
  std::map<std::string, std::string> files;
  for (const campaign::Experiment& one : next) {
    const std::string file = one.name + ".csv";
    entries.push_back(ProgramEntry(one, one.name, file));
    files[file] = DataOf(PlanOf(one), one);
  }
  ASSIGN_OR_RETURN(
      const std::string text,
      campaign::Derive(methods::All(), base.source.campaign_file(),
                       {.name = absl::StrCat(base.campaign.name, ": next experiment"),
                        .lineage = {.parent = base.status.campaign(), .purpose = "next_experiment"},
                        .experiments = entries,
                        .rows = {row}}));
  ASSIGN_OR_RETURN(const report::CampaignView view,
                   laboratory.Run(base, text, "a run of the tests that may be proposed", files));
  PlanScreen screen{.evaluations = view.status.model_evaluations()};
  std::vector<std::string> unfinished;
  for (std::size_t i = 0; i < next.size(); ++i) {
    ScreenedPlan plan{.experiment = PlanOf(next[i]),
                      .entry = std::move(entries[i]),
                      .file = next[i].name + ".csv"};
    const auto curves = CurvesOf(view, next[i].name, 0, next[i],
                                 static_cast<Eigen::Index>(plan.experiment.path.size()));
    if (curves.empty()) {
      unfinished.push_back(next[i].name);
      continue;
    }
    plan.data = DataOf(plan.experiment, next[i], curves);
    plan.experiment.core_seconds = view.states.at({next[i].name, 0}).core_seconds;
    screen.plans.push_back(std::move(plan));
  }
  if (!unfinished.empty()) {
    screen.warning = absl::StrCat("At the best estimate no run ends of ",
                                  absl::StrJoin(unfinished, ", "), ", which is not proposed");
  }
  if (screen.plans.empty()) screen.why_none = "no test of model.next came to an end";
  return screen;
}

}  // namespace calib::diagnosis
