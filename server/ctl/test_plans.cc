#include "server/ctl/test_plans.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <variant>

#include "dem/catalog/catalog.h"
#include "server/campaign/yaml_text.h"

namespace calib::ctl {

using campaign::YamlNode;

namespace {

constexpr int kReadings = 40;
constexpr double kBeyond = 4;  // times the lowest and the highest pressure so far
constexpr double kOedometricStrain = 0.03;
constexpr double kUnloading = 0.1;  // of the way, once, half-way
constexpr double kDensity = 0.02;   // in porosity

// The way of the control, with one unloading if asked for.
std::vector<double> Path(double last, bool unloading) {
  std::vector<double> path;
  const auto branch = [&path](double from, double to, int count) {
    for (int i = 1; i <= count; ++i) path.push_back(from + (to - from) * i / count);
  };
  if (!unloading) {
    branch(0, last, kReadings);
    return path;
  }
  branch(0, 0.5 * last, kReadings / 2);
  branch(path.back(), (0.5 - kUnloading) * last, kReadings / 8);
  branch(path.back(), 0.5 * last, kReadings / 8);
  branch(path.back(), last, kReadings / 4);
  return path;
}

// Only the control is read of it: runs of a table are not compared with readings. The observables
// stand at one, so that a relative noise is known.
std::string DataText(const campaign::Experiment& pattern, const std::vector<double>& path) {
  std::string text = "axial_strain";
  for (const auto& observable : pattern.observables) text += "," + observable.name;
  text += "\n";
  for (const double strain : path) {
    text += fmt::format("{:.9g}", strain);
    for (std::size_t k = 0; k < pattern.observables.size(); ++k) text += ",1";
    text += "\n";
  }
  return text;
}

// Over which the errors of a covariance fall to 1/e, along neighbouring readings; 0: independent.
double CorrelationLength(const std::vector<double>& control,
                         const campaign::MeasuredObservable& observable) {
  const Eigen::MatrixXd& c = observable.covariance;
  if (c.rows() == 0) return observable.correlation_length;
  double decay = 0;
  double way = 0;
  for (Eigen::Index i = 1; i < c.rows(); ++i) {
    const double correlation = c(i, i - 1) / std::sqrt(c(i, i) * c(i - 1, i - 1));
    if (!(correlation > 0)) return 0;
    decay -= std::log(std::min(1.0, correlation));
    way +=
        std::abs(control[static_cast<std::size_t>(i)] - control[static_cast<std::size_t>(i - 1)]);
  }
  return decay > 0 ? way / decay : 0;
}

// Looser and denser specimens than the pattern's, where they are generated.
std::vector<double> OtherPorosities(const campaign::Experiment& pattern) {
  const auto* recipe = pattern.specimens.empty()
                           ? nullptr
                           : std::get_if<dem::PackingRecipe>(&pattern.specimens.front());
  if (recipe == nullptr) return {};
  const auto rounded = [](double porosity) { return std::round(porosity * 1e6) / 1e6; };
  return {rounded(recipe->porosity + kDensity), rounded(recipe->porosity - kDensity)};
}

}  // namespace

const campaign::Experiment& PatternOf(const campaign::Campaign& campaign) {
  return *std::find_if(campaign.experiments.begin(), campaign.experiments.end(),
                       [](const auto& e) { return e.role == campaign::Role::kCalibrate; });
}

std::string WhyNoPlans(const campaign::Campaign& campaign) {
  const campaign::Experiment& pattern = PatternOf(campaign);
  const auto pressure = pattern.settings.find("confining_pressure");
  if (pressure == pattern.settings.end() || !(pressure->second > 0) ||
      pattern.control_name != "axial_strain" || pattern.control.empty()) {
    return "tests are planned that are driven by axial_strain under a confining pressure, and the "
           "first fitted one is not; other settings of it and observables that were not read "
           "(`calibctl tests`) are for you to choose";
  }
  if (pattern.loading_rate) {
    return "tests without a loading_rate are planned, and the first fitted one has one; another "
           "rate, a quarter or four times it, shows what depends on it";
  }
  if (pattern.initial_stress) {
    return "tests that start from an isotropic stress are planned, and the first fitted one has "
           "an initial_stress";
  }
  return "";
}

std::vector<TestPlan> PlansFor(const campaign::Campaign& campaign) {
  const campaign::Experiment& pattern = PatternOf(campaign);
  std::set<double> pressures;
  for (const campaign::Experiment& e : campaign.experiments) {
    const auto found = e.settings.find("confining_pressure");
    if (found != e.settings.end() && found->second > 0) pressures.insert(found->second);
  }
  std::vector<TestPlan> plans;
  if (!WhyNoPlans(campaign).empty()) return plans;
  const double low = *pressures.begin();
  const double high = *pressures.rbegin();
  const double strain = *std::max_element(pattern.control.begin(), pattern.control.end());
  const auto add = [&](const std::string& test, double pressure, bool unloading,
                       std::optional<double> porosity = std::nullopt) {
    const double last = test == "oedometric" ? std::min(strain, kOedometricStrain) : strain;
    const std::string name = fmt::format("next_{}", plans.size() + 1);
    TestPlan& plan = plans.emplace_back();
    plan.experiment.test = test;
    plan.experiment.settings["confining_pressure"] = pressure;
    plan.experiment.unloading = unloading;
    plan.name = name;
    plan.file = name + ".csv";
    plan.data = DataText(pattern, Path(last, unloading));
    if (porosity) plans.back().experiment.settings["porosity"] = *porosity;
  };
  for (const dem::TestInfo& test : dem::Tests()) {
    const auto has = [&test](const std::string& name) {
      return std::find(test.observables.begin(), test.observables.end(), name) !=
             test.observables.end();
    };
    const bool settable =
        test.settings.size() == 1 && test.settings[0].name == "confining_pressure";
    const bool readable = std::all_of(pattern.observables.begin(), pattern.observables.end(),
                                      [&has](const auto& o) { return has(o.name); });
    if (!settable || !readable || test.control != "axial_strain") continue;
    const bool same = test.name == pattern.test;
    if (same) {
      add(test.name, low / kBeyond, false);
      add(test.name, high * kBeyond, false);
      for (const double porosity : OtherPorosities(pattern)) {
        add(test.name, std::sqrt(low * high), false, porosity);
      }
    }
    if (test.may_reverse) {
      add(test.name, std::sqrt(low * high), true);
    } else if (!same) {
      add(test.name, std::sqrt(low * high), false);
    }
  }
  return plans;
}

// The pattern's entry in the campaign file with another test, pressure and measurement.
YamlNode EntryFor(const TestPlan& plan, const campaign::Experiment& pattern,
                  const YamlNode& original) {
  YamlNode entry = original;
  campaign::YamlAt(entry, "name") = campaign::YamlScalar(plan.name);
  campaign::YamlAt(entry, "test") = campaign::YamlScalar(plan.experiment.test);
  for (const auto& [name, value] : plan.experiment.settings) {
    if (name == "porosity") {
      YamlNode& recipe = campaign::YamlAt(campaign::YamlAt(entry, "packing"), "generate");
      campaign::YamlErase(recipe, "void_ratio");
      campaign::YamlAt(recipe, name) = campaign::YamlNumber(value);
    } else {
      campaign::YamlAt(entry, name) = campaign::YamlNumber(value);
    }
  }
  campaign::YamlAt(entry, "data") = campaign::YamlMap(
      {{"file", campaign::YamlScalar(plan.file)}, {"strain", campaign::YamlScalar("logarithmic")}});
  campaign::YamlAt(entry, "control") = campaign::YamlScalar("axial_strain");
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
    double sum = 0;
    for (const double sd : o.sd) sum += sd / static_cast<double>(o.sd.size());
    YamlNode& mean = campaign::YamlAt(campaign::YamlAt(observables, o.name), "noise");
    campaign::YamlErase(mean, "column");
    campaign::YamlErase(mean, "covariance");
    campaign::YamlAt(mean, "absolute") = campaign::YamlNumber(sum);
    const double length = CorrelationLength(pattern.control, o);
    if (length > 0) campaign::YamlAt(mean, "correlation_length") = campaign::YamlNumber(length);
  }
  return entry;
}

}  // namespace calib::ctl
