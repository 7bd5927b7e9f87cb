#include "server/ctl/predicted_tests.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "dem/registry/catalog.h"
#include "server/campaign/file/campaign_file.h"
#include "server/campaign/file/derive.h"
#include "server/campaign/file/parameters/setting_names.h"
#include "server/campaign/file/text/quantity.h"
#include "server/campaign/file/text/yaml_text.h"
#include "server/campaign/model/sha256.h"
#include "server/methods/registry.h"

namespace calib::ctl {
namespace {

using campaign::YamlNode;
using Kind = YamlNode::Kind;

constexpr int kMostReadings = 10000;

absl::StatusOr<std::string> ReadText(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return absl::InvalidArgumentError(absl::StrCat(path, ": no such file"));
  return std::string(std::istreambuf_iterator<char>(file), {});
}

absl::Status ProblemIn(const std::string& path, int line, const std::string& text) {
  return absl::InvalidArgumentError(absl::StrCat(path, ":", line, ": ", text));
}

// control: {column, to, readings} as a table of its own.
// Of a program's test that has no name here (parent: whose program; else nullptr) what drives it
// may be any column, in the unit that its end is written in.
absl::Status SpellOutControl(const std::string& path, const campaign::Campaign* parent,
                             YamlNode& experiment, std::map<std::string, std::string>& files) {
  const YamlNode* control = campaign::YamlFind(experiment, "control");
  const YamlNode* to = control != nullptr ? campaign::YamlFind(*control, "to") : nullptr;
  if (to == nullptr) return absl::OkStatus();
  const YamlNode* column = campaign::YamlFind(*control, "column");
  const YamlNode* readings = campaign::YamlFind(*control, "readings");
  if (campaign::YamlFind(experiment, "data") != nullptr) {
    return ProblemIn(path, control->line,
                     "control.to stands for the readings of a file; give data or to, not both");
  }
  const std::string name = column != nullptr ? column->scalar : "";
  const dem::ObservableInfo* info = dem::FindObservable(name);
  if (name.empty() || (info == nullptr && parent == nullptr)) {
    return ProblemIn(path, control->line,
                     "control.column names what drives the test, e.g. axial_strain");
  }
  const auto written = campaign::SplitQuantity(to->scalar);
  const auto own_unit = campaign::ParseUnit(written.ok() ? written->unit : "");
  const std::string unit = info != nullptr ? info->unit
                           : own_unit.ok() ? campaign::SiName(own_unit->dimension)
                                           : "1";
  const auto end = campaign::ParseQuantity(to->scalar, unit);
  if (!end.ok()) {
    return ProblemIn(path, to->line,
                     absl::StrCat("control.to: ", std::string(end.status().message())));
  }
  const YamlNode* test = campaign::YamlFind(experiment, "test");
  const dem::TestInfo* of_test = test != nullptr ? dem::FindTest(test->scalar) : nullptr;
  const bool whole = of_test != nullptr && of_test->control_range && of_test->control_range->whole;
  int count = whole && *end >= 1 && *end <= kMostReadings ? static_cast<int>(*end) : 20;
  if (readings != nullptr) {
    const auto number = campaign::ParseQuantity(readings->scalar, "1");
    if (!number.ok() || *number != std::floor(*number) || *number < 1 || *number > kMostReadings) {
      return ProblemIn(
          path, readings->line,
          absl::StrCat("control.readings is a whole number from 1 to ", kMostReadings));
    }
    count = static_cast<int>(*number);
  }
  std::string table = name + "\n";
  for (int i = 1; i <= count; ++i) table += fmt::format("{:.17g}\n", *end * i / count);
  const std::string file =
      absl::StrCat("control-", campaign::Sha256Hex(table).substr(0, 16), ".csv");
  campaign::YamlAt(experiment, "data") = campaign::YamlMap(
      {{"file", campaign::YamlScalar(file)}, {"strain", campaign::YamlScalar("logarithmic")}});
  if (parent != nullptr) {
    YamlNode& units = campaign::YamlAt(campaign::YamlAt(experiment, "data"), "units");
    units = campaign::YamlMap({});
    if (info == nullptr) campaign::YamlAt(units, name) = campaign::YamlScalar(unit);
    for (const campaign::Experiment& known : parent->experiments) {
      for (const campaign::MeasuredObservable& observable : known.observables)
        campaign::YamlAt(units, observable.name) = campaign::YamlScalar(observable.unit);
    }
  }
  campaign::YamlAt(experiment, "control") = campaign::YamlScalar(name);
  files[file] = table;
  return absl::OkStatus();
}

// Whether a campaign's program is made of this file, or of what a listing of it names.
bool IsOfProgram(const campaign::Campaign& campaign, const std::string& name) {
  if (!campaign.program) return false;
  const std::string plain = name.ends_with('/') ? name.substr(0, name.size() - 1) : name;
  const auto& files = campaign.program->files;
  return std::any_of(files.begin(), files.end(), [&plain](const campaign::ProgramFile& file) {
    return file.path == plain || file.path.starts_with(plain + "/");
  });
}

// What stands in a test to be predicted is meant, whatever the campaign has found of its own tests.
void KeepAsStated(const campaign::Campaign& campaign, YamlNode& experiment) {
  std::vector<YamlNode> names;
  for (const std::string& name : campaign::StatedBeside(experiment, campaign)) {
    names.push_back(campaign::YamlScalar(name));
  }
  if (!names.empty()) campaign::YamlAt(experiment, "as_stated") = campaign::YamlList(names);
}

}  // namespace

void TakeSpecimen(const YamlNode& from, YamlNode& experiment) {
  const YamlNode* test = campaign::YamlFind(experiment, "test");
  const dem::TestInfo* info = test != nullptr ? dem::FindTest(test->scalar) : nullptr;
  const YamlNode* packing = campaign::YamlFind(from, "packing");
  if (packing == nullptr || campaign::YamlFind(experiment, "packing") != nullptr) return;
  if (info != nullptr && !info->needs_packing) return;
  campaign::YamlAt(experiment, "packing") = *packing;
  const YamlNode* realizations = campaign::YamlFind(from, "realizations");
  if (realizations != nullptr && campaign::YamlFind(experiment, "realizations") == nullptr) {
    campaign::YamlAt(experiment, "realizations") = *realizations;
  }
  const YamlNode* materials = campaign::YamlFind(from, "materials");
  const YamlNode* grains =
      materials != nullptr ? campaign::YamlFind(*materials, "grains") : nullptr;
  if (grains != nullptr && campaign::YamlFind(experiment, "materials") == nullptr) {
    campaign::YamlAt(experiment, "materials") = campaign::YamlMap({{"grains", *grains}});
  }
}

absl::StatusOr<PredictedTests> ReadTests(client::Client& client, const std::string& path,
                                         const report::CampaignView& parent) {
  ASSIGN_OR_RETURN(const auto text, ReadText(path));
  campaign::YamlParse parse = campaign::ParseYaml(text);
  if (parse.error) return ProblemIn(path, parse.error->line, parse.error->message);
  if (parse.root->kind != Kind::kMap) {
    return ProblemIn(path, 1, "is no map; one experiment, or a map with experiments, is expected");
  }
  PredictedTests tests;
  YamlNode list;
  if (const YamlNode* given = campaign::YamlFind(*parse.root, "experiments"); given != nullptr) {
    if (given->kind != Kind::kSequence || given->items.empty()) {
      return ProblemIn(path, given->line, "experiments is no list with at least one experiment");
    }
    list = *given;
  } else if (campaign::YamlFind(*parse.root, "test") != nullptr ||
             campaign::YamlFind(*parse.root, "observables") != nullptr) {
    list = campaign::YamlList({*parse.root});
  } else {
    return ProblemIn(path, 1,
                     "has neither the keys of one experiment (test, observables) nor experiments "
                     "(a list of them)");
  }
  campaign::YamlParse own = campaign::ParseYaml(parent.source.campaign_file());
  if (own.root) campaign::StateNominalValues(*own.root, parent.campaign);
  const YamlNode* first = own.error ? nullptr : campaign::YamlFind(*own.root, "experiments");
  for (YamlNode& experiment : list.items) {
    if (experiment.kind != Kind::kMap) return ProblemIn(path, experiment.line, "is no experiment");
    if (campaign::YamlFind(experiment, "observables") == nullptr) {
      return ProblemIn(path, std::max(experiment.line, 1),
                       "observables is missing; it names what is predicted, e.g. [q_over_p]");
    }
    if (campaign::YamlFind(experiment, "name") == nullptr) {
      const auto number = static_cast<int>(&experiment - list.items.data()) + 1;
      campaign::YamlAt(experiment, "name") = campaign::YamlScalar(
          list.items.size() == 1 ? "predicted" : absl::StrCat("predicted_", number));
    }
    campaign::YamlErase(experiment, "role");
    const bool free_names =
        parent.campaign.program && campaign::YamlFind(experiment, "test") == nullptr;
    RETURN_IF_ERROR(
        SpellOutControl(path, free_names ? &parent.campaign : nullptr, experiment, tests.files));
    KeepAsStated(parent.campaign, experiment);
    if (first != nullptr && !first->items.empty()) TakeSpecimen(first->items.front(), experiment);
  }
  tests.experiments = list.items;
  // Whatever the experiments name is read once, so that problems are found here and files travel.
  const auto derived =
      campaign::Derive(methods::All(), parent.source.campaign_file(),
                       {.name = "prediction",
                        .lineage = {.parent = parent.status.campaign(),
                                    .purpose = ToString(campaign::DerivedFor::kPrediction)},
                        .experiments = tests.experiments,
                        .new_labels = true,
                        .rows = {{.like = 0, .values = [&parent] {
                                    std::map<std::string, double> values;
                                    for (const auto& p : parent.campaign.parameters) {
                                      values[p.name] = p.prior.Quantile(0.5);
                                    }
                                    return values;
                                  }()}}});
  if (!derived.ok()) return derived.status();
  const campaign::FileReader disk = campaign::DiskReader(path);
  std::map<std::string, std::string>& files = tests.files;
  const campaign::FileReader reader = [&](const std::string& name) -> absl::StatusOr<std::string> {
    if (const auto known = files.find(name); known != files.end()) return known->second;
    if (IsOfProgram(parent.campaign, name)) {  // as it was calibrated, whatever lies here now
      const auto kept = parent.source.files().find(name);
      if (kept != parent.source.files().end()) return client.GetBlob(kept->second);
    }
    auto content = disk(name);
    if (content.ok()) files[name] = *content;
    const auto inherited = parent.source.files().find(name);
    if (!content.ok() && inherited != parent.source.files().end()) {
      return client.GetBlob(inherited->second);
    }
    return content;
  };
  const campaign::ReadOutcome outcome =
      campaign::ReadCampaign(methods::All(), *derived, path, reader);
  std::vector<std::string> lines;
  for (campaign::Problem problem : outcome.problems) {
    problem.line = 0;  // of a text the user has not written
    lines.push_back(campaign::ToString(problem));
  }
  if (!lines.empty()) return absl::InvalidArgumentError(absl::StrJoin(lines, "\n"));
  for (const campaign::Experiment& e : outcome.campaign.experiments) {
    for (const campaign::MeasuredObservable& o : e.observables) tests.observables[o.name] = o.unit;
  }
  const auto& populations = parent.campaign.populations;
  for (std::size_t p = 0; p < populations.size(); ++p) {
    const std::vector<std::string>& known = populations[p].labels;
    for (const std::string& label : outcome.campaign.populations[p].labels) {
      if (std::find(known.begin(), known.end(), label) == known.end()) {
        tests.unseen.push_back({.population = p, .label = label});
      }
    }
  }
  return tests;
}

}  // namespace calib::ctl
