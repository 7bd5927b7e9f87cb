#include "server/campaign/file/laboratory_table.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "dem/registry/catalog.h"
#include "server/campaign/file/text/quantity.h"
#include "server/campaign/file/text/suggestion.h"

namespace calib::campaign {
namespace {

constexpr double kLargestStrain = 1;  // logarithmic; beyond it a unit was forgotten

bool IsStrain(const std::string& name) {
  constexpr std::array<const char*, 3> kStrains = {"axial_strain", "volumetric_strain",
                                                   "lateral_strain"};
  return std::find(kStrains.begin(), kStrains.end(), name) != kStrains.end();
}

std::vector<std::string> KnownNames() {
  std::vector<std::string> names;
  for (const dem::ObservableInfo& info : dem::Observables()) names.push_back(info.name);
  return names;
}

std::vector<std::pair<std::string, std::string>> ReadColumns(MapReader& data, bool free_names) {
  auto columns =
      data.TextMap("columns").value_or(std::vector<std::pair<std::string, std::string>>{});
  for (const auto& [name, column] : columns) {
    if (!free_names && dem::FindObservable(name) == nullptr) {
      data.Problem("columns", absl::StrCat(Quoted(name),
                                           " is not an observable (our name: column in the file); ",
                                           Suggestion(name, KnownNames())));
    }
  }
  return columns;
}

std::vector<std::pair<std::string, double>> ReadUnits(MapReader& data, bool free_names) {
  std::vector<std::pair<std::string, double>> factors;
  auto units = data.Map("units");
  if (!units) return factors;
  for (const std::string& name : units->Keys()) {
    const auto text = units->Text(name);
    factors.emplace_back(name,
                         std::nan(""));  // after a problem nothing more is said about the column
    if (!text) continue;
    const auto unit = ParseUnit(*text);
    const dem::ObservableInfo* info = dem::FindObservable(name);
    if (!unit.ok()) {
      units->Problem(name, std::string(unit.status().message()));
    } else if (info == nullptr && !free_names) {
      units->Problem(name, absl::StrCat("is not an observable; ", Suggestion(name, KnownNames())));
    } else if (info != nullptr &&
               !SameKind(unit->dimension, ParseUnit(info->unit).value_or(Unit{}).dimension)) {
      units->Problem(name, absl::StrCat(*text, " is ", KindOfUnit(*text), ", expected ",
                                        KindOfUnit(info->unit)));
    } else {
      factors.back().second = unit->factor;
    }
  }
  units->Finish();
  return factors;
}

template <typename Value>
const Value* FindIn(const std::vector<std::pair<std::string, Value>>& pairs,
                    const std::string& name) {
  for (const auto& [key, value] : pairs) {
    if (key == name) return &value;
  }
  return nullptr;
}

}  // namespace

std::optional<LaboratoryTable> LaboratoryTable::Read(MapReader& experiment,
                                                     const std::vector<std::string>& wanted,
                                                     bool free_names, ReadContext& context) {
  if (experiment.Require("data", "{file: ..., columns: {our_name: column}, units: {...}}") ==
      nullptr) {
    return std::nullopt;
  }
  auto data = experiment.Map("data");
  if (!data) return std::nullopt;
  LaboratoryTable table;
  table.columns_ = ReadColumns(*data, free_names);
  table.factors_ = ReadUnits(*data, free_names);
  constexpr std::array kStrainWords = {
      Word{Strain::kEngineering, "engineering"},
      Word{Strain::kLogarithmic, "logarithmic"},
  };
  table.strain_ = data->Choice("strain", kStrainWords).value_or(table.strain_);
  const auto path = data->RequiredText("file", "the table of measured values");
  data->Finish();
  if (!path) return std::nullopt;
  table.path_ = *path;
  const std::string* text = context.ReadNamedFile(*data, "file", *path);
  if (text == nullptr) return std::nullopt;
  std::vector<std::string> wanted_columns;
  wanted_columns.reserve(wanted.size());
  for (const std::string& name : wanted) wanted_columns.push_back(table.ColumnOf(name));
  std::vector<TableProblem> found;
  table.table_ = std::make_shared<const DataTable>(*text, wanted_columns, found);
  context.AddTableProblems(*path, found);
  if (!found.empty()) return std::nullopt;
  for (const auto& [name, column] : table.columns_) {
    const bool asked = std::find(wanted.begin(), wanted.end(), name) != wanted.end();
    if (!asked && !table.table_->Has(column)) {
      data->Problem("columns",
                    absl::StrCat(name, ": ", Quoted(column), " is not a column of ", *path, "; ",
                                 Suggestion(column, table.table_->columns())));
    }
  }
  return table;
}

std::string LaboratoryTable::ColumnOf(const std::string& name) const {
  const std::string* column = FindIn(columns_, name);
  return column != nullptr ? *column : name;
}

std::vector<double> LaboratoryTable::Raw(const std::string& name, ReadContext& context) const {
  return RawColumn(ColumnOf(name), name, context);
}

std::vector<double> LaboratoryTable::RawColumn(const std::string& column, const std::string& like,
                                               ReadContext& context) const {
  std::vector<TableProblem> found;
  std::vector<double> values = table_->Column(column, found);
  context.AddTableProblems(path_, found);
  if (const double* factor = FindIn(factors_, like)) {
    for (double& value : values) value *= *factor;
  }
  return values;
}

double LaboratoryTable::Factor(const std::string& name) const {
  const double* factor = FindIn(factors_, name);
  return factor != nullptr ? *factor : 1;
}

bool LaboratoryTable::IsEngineering(const std::string& name) const {
  return strain_ == Strain::kEngineering && IsStrain(name);
}

std::vector<double> LaboratoryTable::ToModel(const std::string& name,
                                             const std::vector<double>& raw,
                                             ReadContext& context) const {
  std::vector<double> values = raw;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (std::isnan(raw[i])) continue;
    if (IsEngineering(name)) values[i] = raw[i] < 1 ? -std::log1p(-raw[i]) : HUGE_VAL;
    if (IsStrain(name) && !(std::abs(values[i]) <= kLargestStrain)) {
      context.problems().AddIn(
          path_, LineOf(i), ColumnOf(name),
          absl::StrCat("a strain of ", raw[i],
                       " is not possible; if the column is in percent, say so: units: {", name,
                       ": percent}"));
      values.assign(values.size(), std::nan(""));
      break;
    }
  }
  return values;
}

double LaboratoryTable::Slope(const std::string& name, double raw) const {
  return IsEngineering(name) ? 1 / (1 - raw) : 1;
}

}  // namespace calib::campaign
