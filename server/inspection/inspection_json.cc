#include "server/inspection/inspection_json.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "absl/strings/str_join.h"
#include "server/inspection/header_words.h"

namespace calib::inspection {
namespace {

using Json = nlohmann::ordered_json;

Json ColumnJson(const ColumnMeaning& column) {
  Json json = {{"name", column.name},
               {"unit", column.unit},
               {"meaning", IsObservable(column.role) ? Json(column.role) : Json(nullptr)},
               {"sign", column.sign},
               {"evidence", absl::StrJoin(column.evidence, "; ")},
               {"missing", column.missing}};
  if (!column.role.empty() && !IsObservable(column.role)) json["quantity"] = column.role;
  if (column.open) json["may_be"] = column.options;
  return json;
}

Json FindingJson(const Finding& finding) {
  return {{"kind", WordOf(kFindingWords, finding.kind)},
          {"severity", finding.odd ? "odd" : "note"},
          {"line", finding.line ? Json(*finding.line) : Json(nullptr)},
          {"text", finding.text}};
}

Json TestsJson(const Inspection& inspection) {
  Json tests = Json::array();
  for (std::size_t i = 0; i < inspection.tests.size(); ++i) {
    const InspectedTest& test = inspection.tests[i];
    tests.push_back({{"name", test.name},
                     {"rows", inspection.table.parts[i].lines.size()},
                     {"first_line", inspection.table.parts[i].lines.front()},
                     {"noise", test.noise},
                     {"independent_readings", std::round(test.independent_readings)}});
  }
  return tests;
}

Json FileJson(const InspectedFile& file) {
  if (!file.problems.empty()) {
    Json problems = Json::array();
    for (const campaign::TableProblem& p : file.problems) {
      problems.push_back({{"line", p.line > 0 ? Json(p.line) : Json(nullptr)},
                          {"column", p.column.empty() ? Json(nullptr) : Json(p.column)},
                          {"message", p.message}});
    }
    return {{"file", file.file}, {"problems", problems}};
  }
  const Inspection& inspection = file.inspection;
  Json columns = Json::array();
  for (const ColumnMeaning& column : inspection.columns) columns.push_back(ColumnJson(column));
  Json findings = Json::array();
  for (const Finding& finding : inspection.findings) findings.push_back(FindingJson(finding));
  Json json = {{"file", file.file},
               {"delimiter", DelimiterWord(inspection.table.parting)},
               {"decimal_mark", DecimalWord(inspection.table.mark)},
               {"encoding", inspection.table.encoding},
               {"header_lines", inspection.table.header_lines},
               {"rows", inspection.rows},
               {"columns", columns},
               {"findings", findings},
               {"noise", inspection.noise},
               {"independent_readings", std::round(inspection.independent_readings)}};
  if (!inspection.control.empty()) {
    const ColumnMeaning* control = inspection.Find(inspection.control);
    json["control"] = control != nullptr ? control->name : inspection.control;
  }
  if (!inspection.derived.empty()) {
    json["derived"] = Json::array();
    for (const DerivedQuantity& one : inspection.derived) {
      json["derived"].push_back(
          {{"meaning", one.role}, {"formula", one.formula}, {"unit", one.unit}});
    }
  }
  if (inspection.tests.size() > 1) {
    json["tests_by"] = inspection.table.naming_column.empty()
                           ? Json(nullptr)
                           : Json(inspection.table.naming_column);
    json["tests"] = TestsJson(inspection);
  }
  return json;
}

}  // namespace

const char* DelimiterWord(campaign::Parting parting) {
  switch (parting) {
    case campaign::Parting::kSemicolons:
      return "semicolon";
    case campaign::Parting::kCommas:
      return "comma";
    case campaign::Parting::kTabs:
      return "tab";
    default:
      return "blanks";
  }
}

const char* DecimalWord(campaign::DecimalMark mark) {
  return mark == campaign::DecimalMark::kComma ? "comma" : "point";
}

std::string InspectionJson(const std::vector<InspectedFile>& files) {
  Json json = Json::array();
  for (const InspectedFile& file : files) json.push_back(FileJson(file));
  const Json& answer = files.size() == 1 ? json.front() : json;
  return answer.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace calib::inspection
