#include "server/diagnosis/test_plans.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>
#include <variant>

#include "dem/registry/catalog.h"
#include "server/campaign/file/parameters/setting_names.h"
#include "server/campaign/file/text/yaml_text.h"
#include "server/diagnosis/control_way.h"
#include "server/diagnosis/setting_plans.h"

namespace calib::diagnosis {

using campaign::YamlNode;

namespace {

constexpr double kBeyond = 4;  // times the lowest and the highest pressure, and the rate, so far
constexpr double kOedometricStrain = 0.03;
constexpr double kDensity = 0.02;  // in porosity
constexpr double kEarly = 0.2;     // of the way, an unloading before most of the deformation

// Looser and denser specimens than the pattern's, where they are generated.
std::vector<double> OtherPorosities(const campaign::Experiment& pattern) {
  const auto* recipe = pattern.specimens.empty()
                           ? nullptr
                           : std::get_if<dem::PackingRecipe>(&pattern.specimens.front());
  if (recipe == nullptr) return {};
  const auto rounded = [](double porosity) { return std::round(porosity * 1e6) / 1e6; };
  return {rounded(recipe->porosity + kDensity), rounded(recipe->porosity - kDensity)};
}

bool IsStrainedUnderPressure(const campaign::Experiment& pattern) {
  const auto pressure = pattern.settings.find("confining_pressure");
  return pressure != pattern.settings.end() && pressure->second > 0 &&
         pattern.control_name == "axial_strain" && !pattern.control.empty();
}

// One pressure and an axial strain define it, and it has what was read of the pattern.
bool CanFollow(const dem::TestInfo& test, const campaign::Experiment& pattern) {
  const auto has = [&test](const auto& observable) {
    return std::find(test.observables.begin(), test.observables.end(), observable.name) !=
           test.observables.end();
  };
  return test.settings.size() == 1 && test.settings[0].name == "confining_pressure" &&
         test.control == "axial_strain" &&
         std::all_of(pattern.observables.begin(), pattern.observables.end(), has);
}

// To three digits: nobody sets more.
double Rounded(double pressure) {
  const double digit = std::pow(10, std::floor(std::log10(pressure)) - 2);
  return digit * std::round(pressure / digit);
}

struct Pressures {
  double low = 0, middle = 0, high = 0;
};

Pressures PressuresOf(const campaign::Campaign& campaign) {
  std::set<double> pressures;
  for (const campaign::Experiment& e : campaign.experiments) {
    const auto found = e.settings.find("confining_pressure");
    if (found != e.settings.end() && found->second > 0) pressures.insert(found->second);
  }
  const double low = *pressures.begin();
  const double high = *pressures.rbegin();
  return {.low = low, .middle = Rounded(std::sqrt(low * high)), .high = high};
}

// Signed, and the largest in size.
double LastStrain(const campaign::Experiment& pattern) {
  return *std::max_element(pattern.control.begin(), pattern.control.end(),
                           [](double a, double b) { return std::abs(a) < std::abs(b); });
}

PlannedExperiment UnderPressure(const std::string& test, double pressure, double last_strain) {
  const double last = test == "oedometric" ? std::min(last_strain, kOedometricStrain) : last_strain;
  return {.test = test,
          .settings = {{"confining_pressure", pressure}},
          .control = "axial_strain",
          .path = Monotonic(0, last)};
}

void AddUnloading(double share, PlannedExperiment& planned) {
  const double last = planned.path.back();
  planned.unloading_at = share * last;
  planned.path = WithUnloading(0, last, share);
}

std::vector<PlannedExperiment> PressurePlans(const campaign::Campaign& campaign) {
  const campaign::Experiment& pattern = PatternOf(campaign);
  const Pressures pressures = PressuresOf(campaign);
  std::vector<PlannedExperiment> plans;
  const auto add = [&](const std::string& test, double pressure) -> PlannedExperiment& {
    return plans.emplace_back(UnderPressure(test, pressure, LastStrain(pattern)));
  };
  for (const dem::TestInfo& test : dem::Tests()) {
    if (!CanFollow(test, pattern)) continue;
    const bool same = test.name == pattern.test;
    if (same) {
      add(test.name, pressures.low / kBeyond);
      add(test.name, pressures.high * kBeyond);
      for (const double porosity : OtherPorosities(pattern)) {
        add(test.name, pressures.middle).settings["porosity"] = porosity;
      }
      if (pattern.loading_rate) {
        for (const double factor : {1 / kBeyond, kBeyond}) {
          add(test.name, pressures.middle).settings["loading_rate"] =
              factor * *pattern.loading_rate;
        }
      }
      if (test.may_reverse) AddUnloading(kEarly, add(test.name, pressures.middle));
    }
    if (test.may_reverse) {
      AddUnloading(kHalfWay, add(test.name, pressures.middle));
    } else if (!same) {
      add(test.name, pressures.middle);
    }
  }
  return plans;
}

}  // namespace

const campaign::Experiment& PatternOf(const campaign::Campaign& campaign) {
  return *std::find_if(campaign.experiments.begin(), campaign.experiments.end(),
                       [](const auto& e) { return e.role == campaign::Role::kCalibrate; });
}

PlannedExperiment AsDone(const campaign::Campaign& campaign) {
  const campaign::Experiment& pattern = PatternOf(campaign);
  return IsStrainedUnderPressure(pattern)
             ? UnderPressure(pattern.test, PressuresOf(campaign).middle, LastStrain(pattern))
             : AsMeasured(pattern);
}

std::vector<PlannedExperiment> PlansFor(const campaign::Campaign& campaign) {
  const campaign::Experiment& pattern = PatternOf(campaign);
  return IsStrainedUnderPressure(pattern) ? PressurePlans(campaign) : SettingPlans(pattern);
}

std::vector<TestPlan> Named(std::vector<PlannedExperiment> plans, std::size_t first) {
  std::vector<TestPlan> named;
  for (PlannedExperiment& planned : plans) {
    const std::string name = fmt::format("next_{}", first + named.size());
    named.push_back({.experiment = std::move(planned), .name = name, .file = name + ".csv"});
  }
  return named;
}

std::string DataOf(const PlannedExperiment& planned, const campaign::Experiment& pattern,
                   const std::vector<Eigen::VectorXd>& curves) {
  std::string text = planned.control;
  for (const auto& observable : pattern.observables) text += "," + observable.name;
  text += "\n";
  for (std::size_t i = 0; i < planned.path.size(); ++i) {
    text += fmt::format("{:.9g}", planned.path[i]);
    // Runs of a table are not compared with readings: at one a relative noise is known.
    for (std::size_t k = 0; k < pattern.observables.size(); ++k) {
      text +=
          curves.empty() ? ",1" : fmt::format(",{:.9g}", curves[k][static_cast<Eigen::Index>(i)]);
    }
    text += "\n";
  }
  return text;
}

namespace {

// Settings that differ from the pattern's though a parameter of every test that has them would
// change them.
std::vector<std::string> KeptAsPlanned(const PlannedExperiment& planned,
                                       const campaign::Experiment& pattern,
                                       const campaign::Campaign& campaign) {
  const std::set<std::string> calibrated = campaign::SettingsOfAll(campaign);
  std::vector<std::string> kept;
  for (const auto& [name, value] : planned.settings) {
    const auto own = pattern.settings.find(name);
    if (own != pattern.settings.end() && own->second == value) continue;
    const std::string number = name == "porosity" ? "packing.porosity" : name;
    if (calibrated.contains(number)) kept.push_back(number);
    if (name == "porosity" && calibrated.contains("packing.void_ratio"))
      kept.emplace_back("packing.void_ratio");
  }
  return kept;
}

}  // namespace

std::optional<YamlNode> EntryNamed(const std::string& campaign_file,
                                   const campaign::Campaign& campaign,
                                   const std::string& experiment) {
  campaign::YamlParse parsed = campaign::ParseYaml(campaign_file);
  if (parsed.root) campaign::StateNominalValues(*parsed.root, campaign);
  const YamlNode* list = parsed.root ? campaign::YamlFind(*parsed.root, "experiments") : nullptr;
  if (list == nullptr) return std::nullopt;
  for (const YamlNode& item : list->items) {
    const YamlNode* name = campaign::YamlFind(item, "name");
    if (name != nullptr && name->scalar == experiment) return item;
  }
  return std::nullopt;
}

YamlNode EntryFor(const TestPlan& plan, const campaign::Experiment& pattern,
                  const YamlNode& original, const campaign::Campaign& campaign) {
  YamlNode entry = original;
  campaign::YamlAt(entry, "name") = campaign::YamlScalar(plan.name);
  campaign::YamlAt(entry, "test") = campaign::YamlScalar(plan.experiment.test);
  campaign::YamlErase(entry, plan.experiment.control);  // what drives a test is no setting
  for (const auto& [name, value] : plan.experiment.settings) {
    if (name == "porosity") {
      YamlNode& recipe = campaign::YamlAt(campaign::YamlAt(entry, "packing"), "generate");
      campaign::YamlErase(recipe, "void_ratio");
      campaign::YamlAt(recipe, name) = campaign::YamlNumber(value);
    } else {
      campaign::YamlAt(entry, name) = campaign::YamlNumber(value);
    }
  }
  if (const auto kept = KeptAsPlanned(plan.experiment, pattern, campaign); !kept.empty()) {
    std::vector<YamlNode> names;
    names.reserve(kept.size());
    for (const std::string& name : kept) names.push_back(campaign::YamlScalar(name));
    campaign::YamlAt(entry, "as_stated") = campaign::YamlList(std::move(names));
  }
  const auto pressure = plan.experiment.settings.find("confining_pressure");
  if (pattern.initial_stress && pressure != plan.experiment.settings.end()) {
    const double ratio = pressure->second / pattern.settings.at("confining_pressure");
    campaign::YamlAt(entry, "initial_stress") = campaign::YamlMap(
        {{"axial", campaign::YamlNumber(ratio * pattern.initial_stress->axial)},
         {"lateral", campaign::YamlNumber(ratio * pattern.initial_stress->lateral)}});
  }
  YamlNode& data = campaign::YamlAt(entry, "data");
  data = campaign::YamlMap({{"file", campaign::YamlScalar(plan.file)}});
  const dem::TestInfo* const test = dem::FindTest(plan.experiment.test);
  if (test != nullptr && test->needs_packing && !test->poured) {  // one that reads strains
    campaign::YamlAt(data, "strain") = campaign::YamlScalar("logarithmic");
  }
  campaign::YamlAt(entry, "control") = campaign::YamlScalar(plan.experiment.control);
  campaign::YamlErase(entry, "role");
  campaign::YamlErase(entry, "segments");
  YamlNode& observables = campaign::YamlAt(entry, "observables");
  for (const campaign::MeasuredObservable& o : pattern.observables) {
    // Errors given reading by reading belong to the old readings.
    const YamlNode* noise = campaign::YamlFind(observables, o.name);
    const YamlNode* inner = noise != nullptr ? campaign::YamlFind(*noise, "noise") : nullptr;
    if (inner == nullptr || (campaign::YamlFind(*inner, "column") == nullptr &&
                             campaign::YamlFind(*inner, "covariance") == nullptr)) {
      continue;
    }
    YamlNode& mean = campaign::YamlAt(campaign::YamlAt(observables, o.name), "noise");
    campaign::YamlErase(mean, "column");
    campaign::YamlErase(mean, "covariance");
    campaign::YamlAt(mean, "absolute") = campaign::YamlNumber(*campaign::LawOf(o).absolute);
    const double length = campaign::CorrelationLengthOf(pattern.control, o);
    if (length > 0) campaign::YamlAt(mean, "correlation_length") = campaign::YamlNumber(length);
  }
  return entry;
}

}  // namespace calib::diagnosis
