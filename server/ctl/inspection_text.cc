#include "server/ctl/inspection_text.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "server/inspection/header_words.h"
#include "server/inspection/inspection_json.h"
#include "server/report/text/people_units.h"
#include "server/report/text/text_table.h"

namespace calib::ctl {
namespace {

using inspection::Inspection;

// What is drawn over the control, the first that the file has.
constexpr const char* kDrawn[] = {"deviatoric_stress", "q_over_p",     "stress_ratio",
                                  "shear_stress",      "axial_stress", "mean_stress",
                                  "void_ratio",        "porosity",     "volumetric_strain"};

std::string Plot(const Inspection& inspection, const report::TerminalStyle& style) {
  if (inspection.control.empty()) return "";
  const auto axis = [&inspection](const std::string& role) {
    const std::string unit = inspection.Find(role) != nullptr ? inspection.Find(role)->unit
                                                              : inspection.FindDerived(role)->unit;
    return absl::StrCat(role, unit.empty() || unit == "1" ? "" : absl::StrCat(" [", unit, "]"));
  };
  const auto numbers = [&inspection](std::size_t test, const std::string& role) {
    const double factor = inspection.Find(role) != nullptr ? inspection.Find(role)->factor
                                                           : inspection.FindDerived(role)->factor;
    std::vector<double> values = inspection.Values(test, role);
    for (double& v : values) v /= factor;
    return values;
  };
  for (const char* role : kDrawn) {
    if (!inspection.Has(role) || inspection.control == role) continue;
    std::vector<report::TerminalCurve> curves;
    constexpr std::size_t kMostCurves = 6;  // signs and colours that are told apart
    for (std::size_t i = 0; i < std::min(inspection.tests.size(), kMostCurves); ++i) {
      curves.push_back({.name = inspection.tests[i].name,
                        .x = numbers(i, inspection.control),
                        .y = numbers(i, role)});
    }
    return report::TerminalPlot(curves, {.x = axis(inspection.control), .y = axis(role)}, style);
  }
  return "";
}

std::string Meaning(const inspection::ColumnMeaning& column) {
  if (column.open) return "? " + absl::StrJoin(column.options, " | ");
  if (column.role.empty()) return "";
  const std::string sign = column.sign < 0 ? "-" : "";
  return inspection::IsObservable(column.role) ? sign + column.role
                                               : absl::StrCat("(", column.role, ")");
}

// "1 row", "12 rows".
std::string Counted(std::size_t count, const char* what) {
  return absl::StrCat(count, " ", what, count == 1 ? "" : "s");
}

}  // namespace

std::string InspectionText(const Inspection& inspection, const report::TerminalStyle& style) {
  const inspection::InspectedTable& table = inspection.table;
  std::string text = absl::StrCat(
      inspection.file, ": ", Counted(inspection.rows, "row"), ", cells parted by ",
      inspection::DelimiterWord(table.parting), ", decimal ", inspection::DecimalWord(table.mark),
      ", ", table.encoding, ", ", Counted(table.header_lines, "line"), " above the rows\n");
  if (inspection.tests.size() > 1) {
    std::vector<std::string> names;
    constexpr std::size_t kShown = 8;
    for (const auto& test : inspection.tests) {
      if (names.size() < kShown) names.push_back(test.name);
    }
    if (inspection.tests.size() > kShown) names.emplace_back("...");
    absl::StrAppend(
        &text, report::Wrapped(
                   absl::StrCat(inspection.tests.size(), table.names_stages ? " stages" : " tests",
                                table.naming_column.empty()
                                    ? " in sections"
                                    : absl::StrCat(" by column ", table.naming_column),
                                ": ", absl::StrJoin(names, ", ")),
                   "", "  "));
  }
  report::TextTable columns({"<column", "<seems to be", "<unit", "missing", "noise"});
  for (const inspection::ColumnMeaning& column : inspection.columns) {
    const auto noise = inspection.noise.find(column.name);
    columns.AddRow({column.name, Meaning(column), column.unit,
                    column.missing > 0 ? absl::StrCat(column.missing) : "",
                    noise != inspection.noise.end() ? report::Number(noise->second, 2) : ""});
  }
  absl::StrAppend(&text, "\n", columns.ToString(), "\n");
  for (const inspection::ColumnMeaning& column : inspection.columns) {
    if (column.evidence.empty()) continue;
    absl::StrAppend(&text, report::Wrapped(absl::StrJoin(column.evidence, "; "),
                                           absl::StrCat("  ", column.name, ": "), "      "));
  }
  absl::StrAppend(&text, "\n");
  for (const bool odd : {true, false}) {
    for (const inspection::Finding& finding : inspection.findings) {
      if (finding.odd != odd) continue;
      const std::string where = finding.line ? absl::StrCat("line ", *finding.line, ": ") : "";
      absl::StrAppend(&text, report::Wrapped(where + finding.text, odd ? "! " : "- ", "  "));
    }
  }
  absl::StrAppend(&text, "\nAbout ", std::round(inspection.independent_readings), " of ",
                  Counted(inspection.rows, "row"), " say something of their own.\n");
  const std::string plot = Plot(inspection, style);
  return plot.empty() ? text : absl::StrCat(text, "\n", plot);
}

}  // namespace calib::ctl
