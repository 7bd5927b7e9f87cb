#include "server/ctl/next_experiment.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "dem/catalog/catalog.h"
#include "server/campaign/derive.h"
#include "server/campaign/yaml_text.h"

namespace calib::ctl {
namespace {

using campaign::YamlNode;
using Eigen::Index;

constexpr int kReadings = 40;
constexpr double kLevel = 0.01;
constexpr double kBeyond = 4;  // times the lowest and the highest pressure so far
constexpr double kOedometricStrain = 0.03;
constexpr double kUnloading = 0.1;  // of the way, once, half-way

struct Plan {
  PlannedExperiment experiment;
  std::string name, file, data;  // data: the file's text
};

const campaign::Experiment& Pattern(const campaign::Campaign& campaign) {
  return *std::find_if(campaign.experiments.begin(), campaign.experiments.end(),
                       [](const auto& e) { return e.role == campaign::Role::kCalibrate; });
}

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

std::vector<Plan> PlansFor(const campaign::Campaign& campaign) {
  const campaign::Experiment& pattern = Pattern(campaign);
  std::set<double> pressures;
  for (const campaign::Experiment& e : campaign.experiments) {
    const auto found = e.settings.find("confining_pressure");
    if (found != e.settings.end() && found->second > 0) pressures.insert(found->second);
  }
  std::vector<Plan> plans;
  if (pressures.empty() || pattern.control_name != "axial_strain" || pattern.loading_rate ||
      pattern.initial_stress || pattern.control.empty()) {
    return plans;
  }
  const double low = *pressures.begin();
  const double high = *pressures.rbegin();
  const double strain = *std::max_element(pattern.control.begin(), pattern.control.end());
  const auto add = [&](const std::string& test, double pressure, bool unloading) {
    const double last = test == "oedometric" ? std::min(strain, kOedometricStrain) : strain;
    const std::string name = fmt::format("next_{}", plans.size() + 1);
    plans.push_back({.experiment = {.test = test,
                                    .settings = {{"confining_pressure", pressure}},
                                    .unloading = unloading},
                     .name = name,
                     .file = name + ".csv",
                     .data = DataText(pattern, Path(last, unloading))});
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
YamlNode EntryFor(const Plan& plan, const campaign::Experiment& pattern, const YamlNode& original) {
  YamlNode entry = original;
  campaign::YamlAt(entry, "name") = campaign::YamlScalar(plan.name);
  campaign::YamlAt(entry, "test") = campaign::YamlScalar(plan.experiment.test);
  for (const auto& [name, value] : plan.experiment.settings) {
    campaign::YamlAt(entry, name) = campaign::YamlNumber(value);
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
    if (inner == nullptr || campaign::YamlFind(*inner, "column") == nullptr) continue;
    double sum = 0;
    for (const double sd : o.sd) sum += sd / static_cast<double>(o.sd.size());
    campaign::YamlAt(observables, o.name) = campaign::YamlMap(
        {{"noise", campaign::YamlMap({{"absolute", campaign::YamlNumber(sum)}})}});
  }
  return entry;
}

// Error stated for a reading of this size: that of the nearest one measured.
double ErrorAt(const campaign::MeasuredObservable& observable, double value) {
  std::size_t nearest = 0;
  for (std::size_t i = 1; i < observable.values.size(); ++i) {
    if (std::abs(observable.values[i] - value) < std::abs(observable.values[nearest] - value)) {
      nearest = i;
    }
  }
  return observable.sd[nearest];
}

// Curves of one run, [observable][reading]; empty: it did not finish.
std::vector<Eigen::VectorXd> CurvesOf(const report::CampaignView& view, const std::string& name,
                                      const campaign::Experiment& pattern, Index readings) {
  const auto found = view.states.find({name, 0});
  if (found == view.states.end() || static_cast<Index>(found->second.states.size()) < readings) {
    return {};
  }
  std::vector<Eigen::VectorXd> curves;
  for (const campaign::MeasuredObservable& o : pattern.observables) {
    const auto& names = found->second.observables;
    const auto at = std::find(names.begin(), names.end(), o.name);
    if (at == names.end()) return {};
    Eigen::VectorXd& curve = curves.emplace_back(
        Eigen::VectorXd::Constant(readings, std::numeric_limits<double>::quiet_NaN()));
    for (const v1::State& state : found->second.states) {
      if (state.load_step() < readings) {
        curve[state.load_step()] = state.values(static_cast<int>(at - names.begin()));
      }
    }
    if (!curve.allFinite()) return {};
  }
  return curves;
}

// Mahalanobis distance under 1 + 3 scatter^2 1 1^T per curve: scatter of the measurement and of
// both runs.
double Distance(const std::vector<Eigen::VectorXd>& a, const std::vector<Eigen::VectorXd>& b,
                const campaign::Experiment& pattern, double scatter) {
  double square = 0;
  for (std::size_t j = 0; j < a.size(); ++j) {
    Eigen::VectorXd u = a[j] - b[j];
    for (Index i = 0; i < u.size(); ++i) {
      u[i] /= ErrorAt(pattern.observables[j], 0.5 * (a[j][i] + b[j][i]));
    }
    const double s = 3 * scatter * scatter;
    const auto n = static_cast<double>(u.size());
    square += u.squaredNorm() - s / (1 + s * n) * u.sum() * u.sum();  // Sherman-Morrison
  }
  return std::sqrt(std::max(0.0, square));
}

}  // namespace

absl::StatusOr<std::optional<NextExperiment>> PlanNextExperiment(Laboratory& laboratory,
                                                                 const std::vector<Rival>& rivals,
                                                                 int like, double scatter) {
  if (rivals.size() < 2) return std::nullopt;
  const report::CampaignView& base = *rivals.front().view;
  if (base.campaign.filter.noise != inference::NoiseMode::kGiven) return std::nullopt;
  const campaign::Experiment& pattern = Pattern(base.campaign);
  std::vector<Plan> plans = PlansFor(base.campaign);
  const auto parsed = campaign::ParseYaml(base.source.campaign_file());
  if (plans.empty() || !parsed.root) return std::nullopt;
  const YamlNode* list = campaign::YamlFind(*parsed.root, "experiments");
  if (list == nullptr) return std::nullopt;
  const auto original =
      std::find_if(list->items.begin(), list->items.end(), [&pattern](const YamlNode& item) {
        const YamlNode* name = campaign::YamlFind(item, "name");
        return name != nullptr && name->scalar == pattern.name;
      });
  if (original == list->items.end()) return std::nullopt;

  std::map<std::string, std::string> files;
  std::vector<YamlNode> entries;
  for (const Plan& plan : plans) {
    entries.push_back(EntryFor(plan, pattern, *original));
    files[plan.file] = plan.data;
  }
  NextExperiment next;
  std::vector<std::vector<std::vector<Eigen::VectorXd>>> curves;  // [rival][plan][observable]
  double core_hours = 0;
  for (const Rival& rival : rivals) {
    const auto text = campaign::Derive(
        rival.view->source.campaign_file(),
        {.name = fmt::format("{}: next experiment", rival.view->campaign.name),
         .lineage = {.parent = base.status.campaign(), .purpose = "next_experiment"},
         .experiments = entries,
         .rows = {{.like = like, .values = rival.values}}});
    if (!text.ok()) return text.status();
    const auto view = laboratory.Run(*rival.view, *text,
                                     "planning the next experiment with " + rival.name, files);
    if (!view.ok()) return view.status();
    next.evaluations += view->status.model_evaluations();
    core_hours += view->status.core_hours();
    next.separates.push_back(rival.name);
    auto& own = curves.emplace_back();
    for (const Plan& plan : plans) {
      const auto readings =
          static_cast<Index>(std::count(plan.data.begin(), plan.data.end(), '\n') - 1);
      own.push_back(CurvesOf(*view, plan.name, pattern, readings));
    }
  }
  constexpr double kSecondsPerHour = 3600;
  next.core_seconds = next.evaluations > 0
                          ? core_hours * kSecondsPerHour / static_cast<double>(next.evaluations)
                          : 0;
  const boost::math::normal normal;
  std::vector<std::size_t> finished;
  for (std::size_t p = 0; p < plans.size(); ++p) {
    double closest = std::numeric_limits<double>::infinity();
    for (std::size_t a = 0; a < rivals.size(); ++a) {
      for (std::size_t b = 0; b < a; ++b) {
        closest = curves[a][p].empty() || curves[b][p].empty()
                      ? std::numeric_limits<double>::quiet_NaN()
                      : std::min(closest, Distance(curves[a][p], curves[b][p], pattern, scatter));
      }
    }
    if (!std::isfinite(closest)) continue;
    plans[p].experiment.distance = closest;
    plans[p].experiment.expected_power =
        boost::math::cdf(normal, closest - boost::math::quantile(normal, 1 - kLevel));
    finished.push_back(p);
  }
  if (finished.empty()) return std::nullopt;
  std::stable_sort(finished.begin(), finished.end(), [&plans](std::size_t a, std::size_t b) {
    return plans[a].experiment.distance > plans[b].experiment.distance;
  });
  for (const std::size_t p : finished) next.considered.push_back(plans[p].experiment);
  const Plan& best = plans[finished.front()];
  next.best = best.experiment;
  YamlNode snippet = entries[finished.front()];
  campaign::YamlAt(campaign::YamlAt(snippet, "data"), "file") =
      campaign::YamlScalar("measurement_to_be_made.csv");
  next.snippet = campaign::ToYaml(
      campaign::YamlMap({{"experiments", campaign::YamlList({std::move(snippet)})}}));
  return next;
}

}  // namespace calib::ctl
