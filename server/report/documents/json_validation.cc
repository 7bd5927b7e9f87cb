// What `validate` answers, as JSON.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "dem/registry/catalog.h"
#include "server/report/documents/json_documents.h"
#include "server/report/documents/json_text.h"
#include "server/report/text/people_units.h"

namespace calib::report {
namespace {

using Json = nlohmann::ordered_json;

Json ObservableJson(const campaign::ObservableSummary& summary) {
  const DisplayUnit unit = UnitForPeople(summary.name, summary.unit,
                                         std::fmax(std::abs(summary.min), std::abs(summary.max)));
  return {{"name", summary.name},
          {"readings", summary.readings},
          {"missing", summary.missing},
          {"first", summary.first * unit.factor},
          {"last", summary.last * unit.factor},
          {"unit", unit.label.empty() ? "1" : unit.label},
          {"sd_min", summary.sd_min * unit.factor},
          {"sd_max", summary.sd_max * unit.factor}};
}

Json SummaryJson(const campaign::ExperimentSummary& summary) {
  const DisplayUnit unit = UnitForPeople(summary.control, summary.control_unit,
                                         std::fmax(std::abs(summary.from), std::abs(summary.to)));
  const DisplayUnit length = UnitForPeople("d50", "m", summary.d50);
  Json observables = Json::array();
  for (const campaign::ObservableSummary& observable : summary.observables) {
    observables.push_back(ObservableJson(observable));
  }
  return {{"name", summary.name},
          {"path",
           {{"control", summary.control.empty() ? Json(nullptr) : Json(summary.control)},
            {"from", summary.from * unit.factor},
            {"to", summary.to * unit.factor},
            {"unit", unit.label.empty() ? "1" : unit.label},
            {"turning_points", summary.turning_points}}},
          {"observables", observables},
          {"grains", summary.grains > 0 ? Json(summary.grains) : Json(nullptr)},
          {"d50", summary.d50 * length.factor},
          {"d50_unit", length.label},
          {"porosity", summary.porosity}};
}

}  // namespace

std::string ProblemsJson(const std::vector<campaign::Problem>& problems,
                         const std::vector<campaign::Warning>& warnings,
                         const std::vector<std::string>& notes,
                         const std::vector<campaign::ExperimentSummary>& experiments,
                         const std::vector<campaign::Calibratable>& calibratable) {
  Json wrong = Json::array();
  for (const campaign::Problem& p : problems) {
    wrong.push_back({{"file", p.file},
                     {"line", p.line},
                     {"key", p.key},
                     {"message", p.message},
                     {"kind", p.kind.empty() ? Json(nullptr) : Json(p.kind)}});
  }
  Json odd = Json::array();
  for (const campaign::Warning& w : warnings) {
    odd.push_back({{"kind", WordOf(campaign::kWarningKindWords, w.kind)},
                   {"experiment", w.experiment.empty() ? Json(nullptr) : Json(w.experiment)},
                   {"name", w.name.empty() ? Json(nullptr) : Json(w.name)},
                   {"message", w.message}});
  }
  Json read = Json::array();
  for (const campaign::ExperimentSummary& experiment : experiments) {
    read.push_back(SummaryJson(experiment));
  }
  Json names = Json::array();
  for (const campaign::Calibratable& one : calibratable) {
    names.push_back({{"name", one.name},
                     {"unit", one.unit},
                     {"experiments", one.experiments},
                     {"meaning", one.meaning}});
  }
  const Json answer = {{"valid", problems.empty()}, {"problems", wrong},
                       {"warnings", odd},           {"notes", notes},
                       {"experiments", read},       {"calibratable", names}};
  return Dump(answer);
}

}  // namespace calib::report
