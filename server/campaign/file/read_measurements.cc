#include "server/campaign/file/read_measurements.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "dem/registry/catalog.h"
#include "server/campaign/checks/in_words.h"
#include "server/campaign/checks/test_ties.h"
#include "server/campaign/file/laboratory_table.h"
#include "server/campaign/file/observable_range.h"
#include "server/campaign/file/read_noise.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/model/control_path.h"
#include "server/campaign/model/range.h"

namespace calib::campaign {
namespace {

struct ControlSpec {
  std::string name;             // ours; empty: none
  std::optional<double> noise;  // standard deviation, SI
};

ControlSpec ReadControl(MapReader& map, const MeasurementRules& rules, const dem::TestInfo* test) {
  ControlSpec control;
  const std::string usual = test != nullptr ? test->control : "axial_strain";
  const YamlNode* node = map.Find("control");
  if (node == nullptr) {
    if (!rules.free_names) {
      map.Problem("control",
                  absl::StrCat("is missing; the model is driven along it, e.g. control: ", usual));
    }
    return control;
  }
  if (node->kind == YamlNode::Kind::kMap) {
    if (auto inner = map.Map("control")) {
      control.name =
          inner->RequiredText("column", "the name of the control, e.g. " + usual).value_or("");
      const dem::ObservableInfo* info = dem::FindObservable(control.name);
      control.noise = inner->Quantity("noise", info != nullptr ? info->unit : "1", {.min = 0});
      inner->Finish();
    }
  } else {
    control.name = map.Text("control").value_or("");
  }
  if (!rules.free_names && test != nullptr && !control.name.empty()) {
    std::vector<std::string> controls = {test->control};
    controls.insert(controls.end(), test->other_controls.begin(), test->other_controls.end());
    if (!test->stress_control.empty()) controls.push_back(test->stress_control);
    if (std::find(controls.begin(), controls.end(), control.name) == controls.end()) {
      map.Problem("control", absl::StrCat(Quoted(control.name), " cannot drive ", test->name,
                                          "; it is driven by ", absl::StrJoin(controls, " or ")));
      control.name.clear();
    }
  }
  return control;
}

// The observables' names with their own maps (nullptr: none given).
struct ObservableSpec {
  std::string name;
  const YamlNode* node = nullptr;
};

std::vector<ObservableSpec> ReadObservableNames(MapReader& map) {
  std::vector<ObservableSpec> specs;
  const YamlNode* node = map.Require(
      "observables",
      "it names what is compared, e.g. {stress_ratio: {noise: {relative: 0.02, floor: 0.01}}}");
  if (node == nullptr) return specs;
  if (node->kind == YamlNode::Kind::kMap) {
    for (const YamlEntry& entry : node->entries) {
      const auto same = [&entry](const ObservableSpec& spec) { return spec.name == entry.key; };
      if (std::any_of(specs.begin(), specs.end(), same)) {
        map.problems().Add(entry.line, map.PathOf("observables." + entry.key),
                           "stands here twice; keep one");
      } else {
        specs.push_back({entry.key, &entry.value});
      }
    }
  } else if (const auto names = map.TextList("observables")) {
    for (const std::string& name : *names) specs.push_back({name, nullptr});
  }
  if (specs.empty()) {
    map.Problem("observables", "is empty; at least one observable has to be compared");
  }
  return specs;
}

// Whether the test gives the observable and it is not the control itself.
bool Comparable(const MapReader& map, const std::string& name, const ControlSpec& control,
                const MeasurementRules& rules, const dem::TestInfo* test) {
  const std::string key = "observables." + name;
  std::string message;
  if (name == control.name) {
    message = "is the control: the model follows it exactly, there is nothing to compare";
  } else if (!rules.free_names && test != nullptr &&
             std::find(test->observables.begin(), test->observables.end(), name) ==
                 test->observables.end()) {
    message = absl::StrCat("is not an observable of ", test->name, "; ",
                           Suggestion(name, test->observables));
  }
  if (message.empty()) return true;
  map.problems().Add(map.LineOf("observables"), map.PathOf(key), message);
  return false;
}

// What the test holds says nothing of any parameter.
void CheckFree(const MapReader& map, const std::string& name, const ControlSpec& control,
               const Experiment& experiment) {
  if (!IsHeld(experiment.test, experiment.settings, control.name, name)) return;
  map.problems().Add(map.LineOf("observables"), map.PathOf("observables." + name),
                     absl::StrCat("is held by ", experiment.test,
                                  ", or given by its control: it says nothing of any parameter; "
                                  "remove it"),
                     "held");
}

// Excursions of less than four noise are no loading.
void CheckNoiseOf(const MapReader& map, const ControlSpec& control, const Experiment& experiment) {
  if (!control.noise || experiment.control.empty()) return;
  const auto [low, high] =
      std::minmax_element(experiment.control.begin(), experiment.control.end());
  const double range =
      std::max(*high, experiment.control_start) - std::min(*low, experiment.control_start);
  if (kNoiseThatTurns * *control.noise < range) return;
  map.Problem("control",
              absl::StrCat("noise of ", InWords(control.name, *control.noise),
                           " swallows the path: "
                           "what is below ",
                           kNoiseThatTurns,
                           " times that is taken for noise, and "
                           "the readings go over ",
                           InWords(control.name, range), " in all; see to its unit"),
              "control_noise");
}

void CheckPath(const MapReader& map, const LaboratoryTable& table, const dem::TestInfo* test,
               const ControlSpec& control, const ControlPath& path) {
  const bool reverses = !path.turning.empty();
  if (reverses && test != nullptr && !test->may_reverse) {
    map.problems().AddIn(
        table.path(), table.LineOf(path.turning.front()), table.ColumnOf(control.name),
        absl::StrCat("the control turns back here, but ", test->name,
                     " cannot be unloaded; if this is noise, state it: control: {column: ",
                     control.name, ", noise: ...}"));
  }
}

// What the control may be.
struct ControlLimits {
  Range range;
  bool whole = false;
  std::string unit = "1";
};

// The control may be one of the test's settings; empty: what its unit allows.
std::optional<ControlLimits> LimitsOf(const dem::TestInfo& test, const std::string& control) {
  if (control == test.control) {
    const auto& range = test.control_range;
    if (!range) return std::nullopt;
    const dem::ObservableInfo* info = dem::FindObservable(control);
    return ControlLimits{.range = {.min = range->min, .max = range->max},
                         .whole = range->whole,
                         .unit = info != nullptr ? info->unit : "1"};
  }
  const auto setting = std::find_if(test.settings.begin(), test.settings.end(),
                                    [&control](const auto& s) { return s.name == control; });
  if (setting == test.settings.end()) return std::nullopt;
  return ControlLimits{
      .range = AdmissibleRange(*setting), .whole = setting->whole, .unit = setting->unit};
}

void CheckRange(const LaboratoryTable& table, const dem::TestInfo& test, const ControlSpec& control,
                const std::vector<double>& readings, ReadContext& context) {
  const std::optional<ControlLimits> limits = LimitsOf(test, control.name);
  if (!limits) return;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const bool whole = !limits->whole || readings[i] == std::round(readings[i]);
    if (limits->range.Contains(readings[i]) && whole) continue;
    const std::string unit = limits->unit == "1" ? "" : " " + limits->unit;
    context.problems().AddIn(
        table.path(), table.LineOf(i), table.ColumnOf(control.name),
        absl::StrCat("is ", readings[i], unit, "; ", test.name, " allows ",
                     limits->whole ? "whole numbers " : "", limits->range.Describe(limits->unit)));
    return;
  }
}

// Loading starts where consolidation ends: strains count from there, stresses from the start
// pressure.
double StartOf(const std::string& control, const Experiment& experiment) {
  if (control == "axial_stress" && experiment.initial_stress) {
    return experiment.initial_stress->axial;
  }
  const dem::ObservableInfo* info = dem::FindObservable(control);
  const auto pressure = experiment.settings.find("confining_pressure");
  const bool stress = info != nullptr && info->unit == "Pa";
  if (stress && pressure != experiment.settings.end()) return pressure->second;
  return 0;
}

// Missing readings as the last one before, to divide the loading by.
std::vector<double> Filled(std::vector<double> values) {
  const auto known = [](double v) { return std::isfinite(v); };
  const auto first = std::find_if(values.begin(), values.end(), known);
  double last = first != values.end() ? *first : 0;
  for (double& value : values) last = value = known(value) ? value : last;
  return values;
}

// The observable whose peak divides the loading, if it was measured.
std::vector<double> Strength(const Experiment& experiment) {
  for (const char* name :
       {"q_over_p", "stress_ratio", "deviatoric_stress", "shear_stress_ratio", "shear_stress"}) {
    for (const MeasuredObservable& observable : experiment.observables) {
      if (observable.name == name && !observable.values.empty()) return Filled(observable.values);
    }
  }
  return {};
}

std::vector<double> Volume(const Experiment& experiment) {
  for (const MeasuredObservable& observable : experiment.observables) {
    if (observable.name == "volumetric_strain") return Filled(observable.values);
  }
  return {};
}

}  // namespace

void ReadMeasurements(MapReader& experiment_map, const MeasurementRules& rules,
                      ReadContext& context, Experiment& experiment) {
  const dem::TestInfo* test = dem::FindTest(experiment.test);
  const ControlSpec control = ReadControl(experiment_map, rules, test);
  const std::vector<ObservableSpec> specs = ReadObservableNames(experiment_map);
  std::vector<std::string> wanted;
  if (!control.name.empty()) wanted.push_back(control.name);
  for (const ObservableSpec& spec : specs) {
    if (rules.measured) wanted.push_back(spec.name);
  }
  auto table = LaboratoryTable::Read(experiment_map, wanted,
                                     {.free = rules.free_names, .by_unit_only = rules.by_unit_only},
                                     context);
  if (table && !control.name.empty()) {
    experiment.rows_without_control = static_cast<int>(table->KeepRowsWith(control.name, context));
  }

  for (const ObservableSpec& spec : specs) {
    if (!Comparable(experiment_map, spec.name, control, rules, test)) continue;
    if (context.is_new() && !rules.free_names)
      CheckFree(experiment_map, spec.name, control, experiment);
    MeasuredObservable observable{.name = spec.name, .values = {}, .sd = {}};
    const bool given = table && (rules.measured || table->Has(spec.name));
    if (table) observable.unit = table->UnitOf(spec.name);
    const std::vector<double> raw = given ? table->Raw(spec.name, context) : std::vector<double>();
    if (given) {
      observable.values = table->ToModel(spec.name, raw, context);
      if (!raw.empty() &&
          std::all_of(raw.begin(), raw.end(), [](double v) { return std::isnan(v); })) {
        context.problems().AddIn(table->path(), 0, table->ColumnOf(spec.name),
                                 "holds no reading in any of its rows");
      }
    }
    ReadNoise(experiment_map, spec.name, spec.node,
              {control.name, rules.noise_needed && rules.measured, rules.measured},
              given ? &*table : nullptr, raw, context, observable);
    if (given) CheckRangeOf(observable, *table, context);
    experiment.observables.push_back(std::move(observable));
  }
  if (!table) return;

  const std::size_t readings = table->rows();
  const std::size_t before = context.problems().size();
  if (control.name.empty()) {
    for (std::size_t i = 0; i < readings; ++i) experiment.control.push_back(static_cast<double>(i));
  } else {
    experiment.control = table->ToModel(control.name, table->Raw(control.name, context), context);
  }
  if (context.problems().size() > before) return;
  experiment.control_name = control.name;
  if (!control.name.empty()) experiment.control_unit = table->UnitOf(control.name);
  experiment.control_start = StartOf(control.name, experiment);
  if (test != nullptr && !rules.free_names) {
    CheckRange(*table, *test, control, experiment.control, context);
  }
  if (context.is_new()) CheckNoiseOf(experiment_map, control, experiment);
  const ControlPath path = test != nullptr && test->separate_points
                               ? AsRead(experiment.control)
                               : CleanControl(experiment.control, experiment.control_start,
                                              control.noise, context.by_first_rules());
  if (!control.name.empty()) CheckPath(experiment_map, *table, test, control, path);
  experiment.path = path.points;
  experiment.segment =
      NameSegments(path, {.strength = Strength(experiment), .volume = Volume(experiment)});
}

}  // namespace calib::campaign
