#include "server/campaign/file/laboratory_table.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "dem/registry/catalog.h"
#include "server/campaign/file/read_table_format.h"
#include "server/campaign/file/text/quantity.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/file/text/workbook.h"

namespace calib::campaign {
namespace {

constexpr double kLargestStrain = 1;  // logarithmic; beyond it a unit was forgotten

constexpr std::array<const char*, 3> kStrains = {"axial_strain", "volumetric_strain",
                                                 "lateral_strain"};

bool IsStrain(const std::string& name) {
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

struct StatedUnits {
  std::vector<std::pair<std::string, double>> factors{};     // our name, to SI
  std::vector<std::pair<std::string, std::string>> names{};  // our name, SI unit
};

StatedUnits ReadUnits(MapReader& data, bool free_names) {
  StatedUnits stated;
  auto& factors = stated.factors;
  auto units = data.Map("units");
  if (!units) return stated;
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
      stated.names.emplace_back(name, SiName(unit->dimension));
    }
  }
  units->Finish();
  return stated;
}

// Whether a key names something that can be read; a problem otherwise.
bool IsReadable(const MapReader& map, const std::string& name, bool free_names) {
  if (free_names || dem::FindObservable(name) != nullptr) return true;
  map.Problem(name, absl::StrCat("is not an observable; ", Suggestion(name, KnownNames())));
  return false;
}

std::string UnitFor(const std::string& name) {
  const dem::ObservableInfo* info = dem::FindObservable(name);
  return info != nullptr ? info->unit : "1";
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
                                                     const TableNames& names,
                                                     ReadContext& context) {
  if (experiment.Require("data", "{file: ..., columns: {our_name: column}, units: {...}}") ==
      nullptr) {
    return std::nullopt;
  }
  auto data = experiment.Map("data");
  if (!data) return std::nullopt;
  LaboratoryTable table;
  table.by_unit_only_ = names.by_unit_only;
  table.columns_ = ReadColumns(*data, names.free);
  StatedUnits units = ReadUnits(*data, names.free);
  table.factors_ = std::move(units.factors);
  table.units_ = std::move(units.names);
  table.ReadZeros(*data, names.free);
  table.strain_ = data->Choice("strain", kStrainWords).value_or(table.strain_);
  table.derived_ = DerivedColumns::Read(*data);
  if (!table.Open(*data, wanted, context)) return std::nullopt;
  for (const auto& [name, column] : table.columns_) {
    const bool asked = std::find(wanted.begin(), wanted.end(), name) != wanted.end();
    if (!asked && !table.Has(name)) {
      data->Problem("columns",
                    absl::StrCat(name, ": ", Quoted(column), " is not a column of ", table.path_,
                                 "; ", Suggestion(column, table.table_->columns())));
    }
  }
  const YamlNode* name = experiment.Find("name");
  table.CompareUnits(wanted, name != nullptr ? name->scalar : "", context);
  return table;
}

void LaboratoryTable::ReadZeros(MapReader& data, bool free_names) {
  if (auto signs = data.Map("sign")) {
    for (const std::string& name : signs->Keys()) {
      const auto sign = signs->Integer(name);
      if (sign == 0) signs->Problem(name, "is 0; a sign is 1 or -1");
      if (IsReadable(*signs, name, free_names) && sign) {
        signs_.emplace_back(name, static_cast<double>(*sign));
      }
    }
    signs->Finish();
  }
  if (auto offsets = data.Map("offset")) {
    for (const std::string& name : offsets->Keys()) {
      const auto offset = offsets->Quantity(name, UnitFor(name), {});
      if (IsReadable(*offsets, name, free_names) && offset) offsets_.emplace_back(name, *offset);
    }
    offsets->Finish();
  }
  const auto zero = data.TextList("zero");
  if (!zero) return;
  const bool strains = zero->size() == 1 && zero->front() == "first";
  from_first_ = strains ? std::vector<std::string>(kStrains.begin(), kStrains.end()) : *zero;
  if (strains) from_first_.emplace_back("shear_strain");
  for (const std::string& name : from_first_) {
    if (!strains && !free_names && dem::FindObservable(name) == nullptr) {
      data.Problem("zero", absl::StrCat(Quoted(name),
                                        " is neither an observable nor 'first', which means all "
                                        "strains; ",
                                        Suggestion(name, KnownNames())));
    } else if (FindIn(offsets_, name) != nullptr) {
      data.Problem("zero", absl::StrCat(name, " has an offset already; keep one of them"));
    }
  }
}

bool LaboratoryTable::Open(MapReader& data, const std::vector<std::string>& wanted,
                           ReadContext& context) {
  const std::size_t before = context.problems().size();
  TableFormat format = ReadTableFormat(data);
  format.first_rules = context.by_first_rules();
  const bool sound = context.problems().size() == before;
  const auto path = data.RequiredText("file", "the table of measured values");
  const auto sheet = data.Text("sheet");
  data.Finish();
  if (!path || !sound) return false;
  path_ = SheetPath(*path, sheet.value_or(""));
  const std::string* text = context.ReadNamedFile(data, "file", path_);
  if (text == nullptr) return false;
  std::vector<std::string> columns = derived_.Words();
  for (const std::string& name : wanted) columns.push_back(ColumnOf(name));
  std::vector<TableProblem> found;
  table_ = std::make_shared<const DataTable>(*text, format, columns, found);
  context.AddTableProblems(path_, found);
  if (!found.empty()) return false;
  if (sheet && !IsWorkbookPath(*path)) {
    data.Problem("sheet", absl::StrCat(*path, " is a text, which holds one table; remove it"));
  }
  const std::size_t computed = context.problems().size();
  derived_.Compute(data, path_, *table_, context);
  for (std::size_t i = 0; i < table_->rows(); ++i) kept_.push_back(i);
  return context.problems().size() == computed;
}

// What a column's heading says of its unit, against what the campaign file says.
void LaboratoryTable::CompareUnits(const std::vector<std::string>& wanted,
                                   const std::string& experiment, ReadContext& context) const {
  constexpr double kSame = 1e-6;  // of the factor: the same unit, written otherwise
  for (const std::string& name : wanted) {
    const std::string heading = table_->UnitOf(ColumnOf(name));
    const auto unit =
        heading.empty() || heading == "-" ? absl::StatusOr<Unit>(Unit{}) : ParseUnit(heading);
    const double used = Factor(name);
    if (heading.empty() || !unit.ok() || std::isnan(used)) continue;
    if (!SameKind(unit->dimension, ParseUnit(UnitFor(name)).value_or(Unit{}).dimension)) continue;
    if (std::abs(unit->factor - used) <= kSame * std::abs(used)) continue;
    context.warnings().push_back(
        {WarningKind::kUnit, experiment, name,
         absl::StrCat("is headed ", Quoted(heading), " in ", path_,
                      ", but its numbers are read as ", used / unit->factor,
                      " times that; if the heading is right, say so: units: {", name, ": ", heading,
                      "}")});
  }
}

bool LaboratoryTable::Has(const std::string& name) const {
  return derived_.Has(ColumnOf(name)) || table_->Has(ColumnOf(name));
}

std::size_t LaboratoryTable::KeepRowsWith(const std::string& name, ReadContext& context) {
  const std::vector<double> values = Raw(name, context);
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isnan(values[i])) kept.push_back(kept_[i]);
  }
  const std::size_t left_out = values.size() - kept.size();
  if (!values.empty()) kept_ = std::move(kept);
  return left_out;
}

std::string LaboratoryTable::ColumnOf(const std::string& name) const {
  const std::string* column = FindIn(columns_, name);
  return column != nullptr ? *column : name;
}

// What the column reads where there is nothing to read, SI and in the sign of the file.
double LaboratoryTable::ZeroOf(const std::string& name, const std::vector<double>& values) const {
  if (const double* offset = FindIn(offsets_, name)) return *offset;
  if (std::find(from_first_.begin(), from_first_.end(), name) == from_first_.end()) return 0;
  const auto first =
      std::find_if(values.begin(), values.end(), [](double v) { return !std::isnan(v); });
  return first != values.end() ? *first : 0;
}

std::vector<double> LaboratoryTable::Raw(const std::string& name, ReadContext& context) const {
  std::vector<double> values = RawColumn(ColumnOf(name), name, context);
  const double* const sign = FindIn(signs_, name);
  const double zero = ZeroOf(name, values);
  if (sign == nullptr && zero == 0) return values;
  for (double& value : values) value = (sign != nullptr ? *sign : 1) * (value - zero);
  return values;
}

std::vector<double> LaboratoryTable::RawColumn(const std::string& column, const std::string& like,
                                               ReadContext& context) const {
  std::vector<TableProblem> found;
  const std::vector<double> all =
      derived_.Has(column) ? derived_.Values(column) : table_->ColumnWithGaps(column, found);
  context.AddTableProblems(path_, found);
  if (!found.empty()) return {};
  const double factor = Factor(like);
  std::vector<double> values;
  for (const std::size_t row : kept_) values.push_back(all[row] * factor);
  return values;
}

std::string LaboratoryTable::UnitOf(const std::string& name) const {
  if (const dem::ObservableInfo* info = dem::FindObservable(name)) return info->unit;
  const std::string* stated = FindIn(units_, name);
  return stated != nullptr ? *stated : "1";
}

double LaboratoryTable::Factor(const std::string& name) const {
  const double* factor = FindIn(factors_, name);
  return factor != nullptr ? *factor : 1;
}

bool LaboratoryTable::IsEngineering(const std::string& name) const {
  return !by_unit_only_ && strain_ == Strain::kEngineering && IsStrain(name);
}

std::vector<double> LaboratoryTable::ToModel(const std::string& name,
                                             const std::vector<double>& raw,
                                             ReadContext& context) const {
  std::vector<double> values = raw;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (std::isnan(raw[i])) continue;
    if (IsEngineering(name)) values[i] = raw[i] < 1 ? -std::log1p(-raw[i]) : HUGE_VAL;
    if (!by_unit_only_ && IsStrain(name) && !(std::abs(values[i]) <= kLargestStrain)) {
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
