#include "server/diagnosis/plan_words.h"

#include <fmt/format.h>

#include <cstddef>

#include "dem/registry/catalog.h"
#include "server/report/text/people_units.h"

namespace calib::diagnosis {
namespace {

// SI, as far as the catalogue knows the quantity.
std::string UnitOf(const std::string& quantity, const dem::TestInfo* test) {
  if (quantity == "loading_rate") return "1/s";
  if (test != nullptr) {
    for (const dem::ParameterInfo& setting : test->settings) {
      if (setting.name == quantity) return setting.unit;
    }
  }
  const dem::ObservableInfo* const observable = dem::FindObservable(quantity);
  return observable != nullptr ? observable->unit : "1";
}

std::string Quantity(const PlannedExperiment& planned, const std::string& name, double value) {
  return report::NumberWithUnit(value, name, UnitOf(name, dem::FindTest(planned.test)), 3);
}

}  // namespace

std::string InWords(const PlannedExperiment& planned) {
  if (!planned.repeats.empty())
    return fmt::format("{} again, on another specimen", planned.repeats);
  std::string text = planned.test;
  for (const auto& [name, value] : planned.settings) {
    text += fmt::format(", {} {}", report::NameForPeople(name), Quantity(planned, name, value));
  }
  if (planned.of_next) {
    for (const auto& [name, value] : planned.told) {
      text += fmt::format(", {} {}", report::NameForPeople(name), value);
    }
  }
  if (planned.control != "axial_strain") {
    text += fmt::format(", driven by {} from {} to {}", report::NameForPeople(planned.control),
                        Quantity(planned, planned.control, planned.path.front()),
                        Quantity(planned, planned.control, planned.path.back()));
  }
  if (!planned.unloading_at) return text;
  return text + fmt::format(", one unloading and reloading at {}",
                            Quantity(planned, planned.control, *planned.unloading_at));
}

std::string WayInWords(const PlannedExperiment& planned) {
  const std::vector<double>& path = planned.path;
  const auto value = [&](double of) { return Quantity(planned, planned.control, of); };
  std::string text = report::NameForPeople(planned.control);
  const dem::TestInfo* test = dem::FindTest(planned.test);
  if (test != nullptr && (test->separate_points || !test->needs_packing)) {
    return text + fmt::format(" at {} values from {} to {}", path.size(), value(path.front()),
                              value(path.back()));
  }
  int turns = 0;
  const auto way = [&turns] { return turns == 0 ? "to" : turns % 2 == 1 ? "back to" : "then to"; };
  for (std::size_t i = 1; i + 1 < path.size(); ++i) {
    if ((path[i] - path[i - 1]) * (path[i + 1] - path[i]) >= 0) continue;
    text += fmt::format(" {} {},", way(), value(path[i]));
    ++turns;
  }
  return text + fmt::format(" {} {}", way(), value(path.back()));
}

}  // namespace calib::diagnosis
