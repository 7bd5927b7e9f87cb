#include "server/campaign/file/parameters/experiment_numbers.h"

#include <algorithm>
#include <array>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "server/campaign/file/text/yaml_text.h"
#include "server/campaign/keys/sections.h"
#include "server/campaign/model/run_settings.h"

namespace calib::campaign {
namespace {

using Kind = YamlNode::Kind;

// A number with its own key, and where that stands below its experiment.
struct KeyedNumber {
  const char* name;
  std::vector<std::string> path;
  const char* section;  // of the last key
  bool optional = false;
};

const std::vector<KeyedNumber>& KeysOfPreparation() {
  static const auto* const keys = new std::vector<KeyedNumber>{
      {"loading_rate", {"loading_rate"}, "experiment", true},
      {"consolidation.friction_coefficient",
       {"consolidation", "friction_coefficient"},
       "consolidation",
       true},
      {"consolidation.porosity", {"consolidation", "porosity"}, "consolidation", true},
      {"initial_stress.axial", {"initial_stress", "axial"}, "initial_stress", true},
      {"initial_stress.lateral", {"initial_stress", "lateral"}, "initial_stress", true},
      {"staging.rate", {"staging", "rate"}, "staging"},
      {"staging.step", {"staging", "step"}, "staging"},
      {"staging.unbalanced", {"staging", "unbalanced"}, "staging"},
      {"staging.damping_loading", {"staging", "damping"}, "staging"},
      {"staging.damping_settling", {"staging", "damping"}, "staging"}};
  return *keys;
}

const std::vector<KeyedNumber>& KeysOfRecipe() {
  static const auto* const keys = new std::vector<KeyedNumber>{
      {"packing.porosity", {"packing", "generate", "porosity"}, "recipe"},
      {"packing.void_ratio", {"packing", "generate", "void_ratio"}, "recipe"},
      {"packing.aspect", {"packing", "generate", "aspect"}, "recipe"},
      {"packing.pressure", {"packing", "generate", "pressure"}, "recipe"}};
  return *keys;
}

// The last key stands in radii or diameters.
const std::vector<KeyedNumber>& KeysOfSizes() {
  static const auto* const keys =
      new std::vector<KeyedNumber>{{"packing.mean_radius", {"mean"}, "sizes"},
                                   {"packing.radius_spread", {"spread"}, "sizes"},
                                   {"packing.median_radius", {"median"}, "sizes"},
                                   {"packing.log_sd", {"log_sd"}, "sizes"}};
  return *keys;
}

const YamlNode* At(const YamlNode& root, const std::vector<std::string>& path) {
  const YamlNode* node = &root;
  for (const std::string& key : path) {
    if (node == nullptr || node->kind != Kind::kMap) return nullptr;
    node = YamlFind(*node, key);
  }
  return node;
}

const YamlNode* SizesIn(const YamlNode& experiment) {
  const YamlNode* radii = At(experiment, {"packing", "generate", "radii"});
  return radii != nullptr ? radii : At(experiment, {"packing", "generate", "diameters"});
}

SizesBy SizesOf(const YamlNode& experiment) {
  if (At(experiment, {"packing", "generate"}) == nullptr) return SizesBy::kNone;
  const YamlNode* sizes = SizesIn(experiment);
  if (sizes == nullptr) return SizesBy::kMean;
  if (YamlFind(*sizes, "cumulative") != nullptr) return SizesBy::kCurve;
  const bool log_normal =
      YamlFind(*sizes, "median") != nullptr || YamlFind(*sizes, "log_sd") != nullptr;
  return log_normal ? SizesBy::kLogNormal : SizesBy::kMean;
}

std::string TextAt(const YamlNode& experiment, const std::vector<std::string>& path) {
  const YamlNode* node = At(experiment, path);
  return node != nullptr && node->kind == Kind::kScalar ? node->scalar : "";
}

ExperimentNumber Keyed(const KeyedNumber& keyed) {
  // What damping lists are its two numbers.
  const Key* key = FindKey(SectionOf(keyed.section), keyed.path.back());
  const Form* form = FindForm(key->form, Form::Kind::kNumber);
  return {.name = keyed.name,
          .unit = form->unit,
          .range = form->range,
          .meaning = key->meaning,
          .optional = keyed.optional};
}

ExperimentNumber OfCatalogue(const dem::ParameterInfo& info) {
  Range range = AdmissibleRange(info);
  return {.name = info.name,
          .unit = info.unit,
          .range = range,
          .whole = info.whole,
          .meaning = info.description};
}

// Each value of a control is a run of its own, so that one of them is a number like others.
void AddControl(const ExperimentOutline& outline, std::vector<ExperimentNumber>& numbers) {
  const dem::TestInfo& test = *outline.test;
  if (!test.separate_points || outline.control != test.control || !test.control_range ||
      test.control_range->whole) {
    return;
  }
  const dem::ObservableInfo* info = dem::FindObservable(test.control);
  numbers.push_back({.name = test.control,
                     .unit = info != nullptr ? info->unit : "1",
                     .range = {.min = test.control_range->min, .max = test.control_range->max},
                     .meaning = "the control, of an experiment with one reading"});
}

// What a number excludes by standing there.
bool IsExcluded(const ExperimentOutline& outline, const std::string& number) {
  const auto states = [&outline](const char* other) { return outline.stated.contains(other); };
  if (states(number.c_str())) return false;
  const bool staged =
      std::any_of(outline.stated.begin(), outline.stated.end(),
                  [](const std::string& name) { return absl::StartsWith(name, "staging."); });
  if (number == "loading_rate") return staged || (outline.test && outline.test->stress_driven);
  if (absl::StartsWith(number, "staging.")) return states("loading_rate");
  if (number == "consolidation.porosity") return states("consolidation.friction_coefficient");
  if (number == "consolidation.friction_coefficient") return states("consolidation.porosity");
  return false;
}

void AddRecipe(const ExperimentOutline& outline, bool in_cell,
               std::vector<ExperimentNumber>& numbers) {
  if (outline.sizes == SizesBy::kNone) return;
  if (in_cell) {
    for (const KeyedNumber& keyed : KeysOfRecipe()) numbers.push_back(Keyed(keyed));
  }
  for (const KeyedNumber& keyed : KeysOfSizes()) {
    const std::string name = keyed.name;
    const bool of_log_normal = name == "packing.median_radius" || name == "packing.log_sd";
    const bool of_mean = name == "packing.radius_spread";
    const bool has = of_log_normal ? outline.sizes == SizesBy::kLogNormal
                     : of_mean     ? outline.sizes == SizesBy::kMean
                                   : outline.sizes != SizesBy::kLogNormal;
    if (has) numbers.push_back(Keyed(keyed));
  }
}

void AddOnce(ExperimentNumber number, std::vector<ExperimentNumber>& all) {
  const auto same = [&number](const ExperimentNumber& other) {
    return other.name == number.name && other.unit == number.unit;
  };
  if (std::none_of(all.begin(), all.end(), same)) all.push_back(std::move(number));
}

// Of an experiment whose test nobody knows.
std::vector<ExperimentNumber> NumbersOfAnyTest(const ExperimentOutline& outline) {
  std::vector<ExperimentNumber> all;
  for (const dem::TestInfo& test : dem::Tests()) {
    ExperimentOutline one = outline;
    one.test = &test;
    for (ExperimentNumber& number : NumbersOf(one)) AddOnce(std::move(number), all);
  }
  return all;
}

YamlNode NumberOf(double value, int line) {
  YamlNode node = YamlNumber(value);
  node.line = line;
  return node;
}

// Puts a value at a path whose maps are made where they are missing.
void Put(const std::vector<std::string>& path, double value, int line, YamlNode& root) {
  YamlNode* node = &root;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const bool last = i + 1 == path.size();
    const YamlNode* found = node->kind == Kind::kMap ? YamlFind(*node, path[i]) : nullptr;
    if (node->kind != Kind::kMap || (found != nullptr && (last || found->kind != Kind::kMap)))
      return;  // it stands there, or what stands there is no map: that is said of itself
    YamlNode& next = YamlAt(*node, path[i]);
    if (found == nullptr) {
      next = last ? NumberOf(value, line) : YamlMap();
      next.line = line;
      node->entries.back().line = line;
    }
    node = &next;
  }
}

}  // namespace

ExperimentOutline OutlineOf(const YamlNode& experiment) {
  ExperimentOutline outline{.name = TextAt(experiment, {"name"}), .line = experiment.line};
  outline.test = dem::FindTest(TextAt(experiment, {"test"}));
  outline.batch = TextAt(experiment, {"batch"});
  outline.control = TextAt(experiment, {"control"});
  if (outline.control.empty()) outline.control = TextAt(experiment, {"control", "column"});
  outline.sizes = SizesOf(experiment);
  const auto state = [&](const std::string& name, const YamlNode* node) {
    if (node != nullptr) outline.stated.insert(name);
  };
  if (experiment.kind == Kind::kMap) {
    for (const YamlEntry& entry : experiment.entries) {
      if (entry.value.kind == Kind::kScalar) outline.stated.insert(entry.key);
    }
  }
  for (const auto* keys : {&KeysOfPreparation(), &KeysOfRecipe()}) {
    for (const KeyedNumber& keyed : *keys) state(keyed.name, At(experiment, keyed.path));
  }
  if (const YamlNode* sizes = SizesIn(experiment)) {
    for (const KeyedNumber& keyed : KeysOfSizes()) state(keyed.name, At(*sizes, keyed.path));
  }
  const YamlNode* shares = At(experiment, {"materials", "grains"});
  if (shares != nullptr && shares->kind == Kind::kMap) {
    for (const YamlEntry& entry : shares->entries) state(kShareOfGrains + entry.key, &entry.value);
  }
  if (const YamlNode* kept = At(experiment, {"as_stated"})) {
    if (kept->kind == Kind::kScalar) outline.as_stated.insert(kept->scalar);
    for (const YamlNode& item : kept->items) outline.as_stated.insert(item.scalar);
  }
  return outline;
}

std::vector<ExperimentOutline> OutlinesOf(const YamlNode* experiments) {
  std::vector<ExperimentOutline> outlines;
  if (experiments == nullptr) return outlines;
  for (const YamlNode& experiment : experiments->items) outlines.push_back(OutlineOf(experiment));
  return outlines;
}

std::vector<ExperimentNumber> NumbersOf(const ExperimentOutline& outline) {
  if (outline.test == nullptr) return NumbersOfAnyTest(outline);
  const dem::TestInfo& test = *outline.test;
  std::vector<ExperimentNumber> numbers;
  for (const dem::ParameterInfo& setting : test.settings) {
    if (setting.name != outline.control) numbers.push_back(OfCatalogue(setting));
  }
  AddControl(outline, numbers);
  const bool in_cell = dem::InPeriodicCell(test);
  if (in_cell) {
    for (const KeyedNumber& keyed : KeysOfPreparation()) {
      if (!IsExcluded(outline, keyed.name)) numbers.push_back(Keyed(keyed));
    }
  }
  if (test.needs_packing) AddRecipe(outline, in_cell, numbers);
  for (const std::string& name : outline.stated) {
    if (!test.needs_packing || !absl::StartsWith(name, kShareOfGrains)) continue;
    numbers.push_back({.name = name,
                       .unit = "1",
                       .range = {.min = 0, .max = 1, .min_open = true},
                       .meaning = "share of the number of grains"});
  }
  const Form* density =
      FindForm(FindKey(SectionOf("model"), kDensityOfGrains)->form, Form::Kind::kNumber);
  numbers.push_back({.name = kDensityOfGrains,
                     .unit = density->unit,
                     .range = density->range,
                     .meaning = "of the grains"});
  std::erase_if(numbers, [&outline](const ExperimentNumber& number) {
    return outline.as_stated.contains(number.name);
  });
  return numbers;
}

std::vector<ExperimentNumber> NumbersOfAllTests() {
  std::vector<ExperimentNumber> all;
  for (const dem::TestInfo& test : dem::Tests()) {
    for (const SizesBy sizes : {SizesBy::kMean, SizesBy::kLogNormal}) {
      for (const std::string& control : {std::string(), test.control}) {
        ExperimentOutline one{.test = &test};
        one.sizes = sizes;
        one.control = control;
        for (ExperimentNumber& number : NumbersOf(one)) AddOnce(std::move(number), all);
      }
    }
  }
  return all;
}

const std::vector<std::string>& GroupsOfNumbers() {
  static const auto* const groups = new std::vector<std::string>{
      "consolidation", "initial_stress", "materials", "numerics", "packing", "staging"};
  return *groups;
}

void StateInFile(const std::string& number, double value, int line, YamlNode& experiment) {
  if (number == kDensityOfGrains || absl::StartsWith(number, "staging.damping")) return;
  const ExperimentOutline outline = OutlineOf(experiment);
  if (outline.stated.contains(number) || number == outline.control) return;
  if (number == "packing.porosity" && outline.stated.contains("packing.void_ratio")) return;
  if (number == "packing.void_ratio" && outline.stated.contains("packing.porosity")) return;
  for (const auto* keys : {&KeysOfPreparation(), &KeysOfRecipe()}) {
    for (const KeyedNumber& keyed : *keys) {
      if (keyed.name == number) return Put(keyed.path, value, line, experiment);
    }
  }
  for (const KeyedNumber& keyed : KeysOfSizes()) {
    if (keyed.name != number) continue;
    if (number == "packing.mean_radius" && outline.sizes != SizesBy::kMean) return;
    const bool by_diameter = At(experiment, {"packing", "generate", "diameters"}) != nullptr;
    const bool length = number == "packing.mean_radius" || number == "packing.median_radius";
    return Put({"packing", "generate", by_diameter ? "diameters" : "radii", keyed.path.back()},
               by_diameter && length ? 2 * value : value, line, experiment);
  }
  if (!absl::StartsWith(number, kShareOfGrains)) Put({number}, value, line, experiment);
}

}  // namespace calib::campaign
