#include "server/diagnosis/plan_json.h"

#include <nlohmann/json.hpp>

#include "server/diagnosis/plan_words.h"

namespace calib::diagnosis {
namespace {

nlohmann::json NumberOrNull(const std::optional<double>& value) {
  return value ? nlohmann::json(*value) : nlohmann::json(nullptr);
}

// What a program is told stands beside what a catalogue knows.
nlohmann::json SettingsJson(const PlannedExperiment& planned) {
  nlohmann::json settings = planned.settings;
  for (const auto& [name, value] : planned.told) settings[name] = nlohmann::json::parse(value);
  return settings;
}

nlohmann::json ForecastJson(const std::optional<PlanForecast>& forecast) {
  if (!forecast) return nullptr;
  return {{"decides", forecast->decides},
          {"names_wrong", forecast->wrong},
          {"told_apart_bits", forecast->bits},
          {"runs", forecast->runs}};
}

}  // namespace

nlohmann::json PlannedJson(const PlannedExperiment& planned) {
  using nlohmann::json;
  return {{"test", planned.test},
          {"repeat_of", planned.repeats.empty() ? json(nullptr) : json(planned.repeats)},
          {"in_words", InWords(planned)},
          {"of_next", planned.of_next},
          {"settings", SettingsJson(planned)},
          {"unloading", planned.unloading_at.has_value()},
          {"unloading_at", NumberOrNull(planned.unloading_at)},
          {"control", planned.control},
          {"control_from", planned.path.front()},
          {"control_to", planned.path.back()},
          {"path", planned.path},
          {"expected_power", planned.expected_power},
          {"forecast", ForecastJson(planned.forecast)},
          {"distance_sd", planned.distance},
          {"points", planned.points},
          {"not_separated", planned.together},
          {"cost",
           {{"core_seconds_per_evaluation",
             planned.core_seconds > 0 ? json(planned.core_seconds) : json(nullptr)}}},
          {"none_of_these",
           {{"distance_sd", NumberOrNull(planned.distance_from_none)},
            {"expected_power", NumberOrNull(planned.power_against_none)}}}};
}

absl::StatusOr<PlannedExperiment> PlannedFrom(const nlohmann::json& json) {
  PlannedExperiment planned;
  try {
    planned.test = json.at("test");
    planned.of_next = json.value("of_next", false);
    for (const auto& [name, value] : json.at("settings").items()) {
      if (planned.of_next || !value.is_number()) {
        planned.told[name] = value.dump();
      } else {
        planned.settings[name] = value;
      }
    }
    planned.control = json.at("control");
    planned.path = json.at("path").get<std::vector<double>>();
    const nlohmann::json& unloading = json.at("unloading_at");
    if (!unloading.is_null()) planned.unloading_at = unloading.get<double>();
    const nlohmann::json& repeats = json.at("repeat_of");
    if (!repeats.is_null()) planned.repeats = repeats;
  } catch (const nlohmann::json::exception&) {
    return absl::InvalidArgumentError("the proposal does not say how the test is made");
  }
  if (planned.path.size() < 2)
    return absl::InvalidArgumentError("the proposal does not say how the test is driven");
  return planned;
}

}  // namespace calib::diagnosis
