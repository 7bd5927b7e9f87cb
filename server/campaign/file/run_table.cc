#include "server/campaign/file/run_table.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "server/campaign/file/text/quantity.h"

namespace calib::campaign {
namespace {

const std::string* FindName(const NameMap& names, const std::string& name) {
  for (const auto& [key, value] : names) {
    if (key == name) return &value;
  }
  return nullptr;
}

}  // namespace

RunTableKeys ReadRunTableKeys(MapReader& map) {
  RunTableKeys keys;
  keys.parameters =
      map.RequiredText("parameters", "the table with one row per sample").value_or("");
  keys.states =
      map.RequiredText("states", "the table with one row per sample and load step").value_or("");
  keys.sample = map.Text("sample").value_or(keys.sample);
  keys.step = map.Text("step").value_or(keys.step);
  keys.experiment = map.Text("experiment").value_or("");
  keys.log_proposal = map.Text("log_proposal").value_or("");
  keys.parameter_columns = map.TextMap("parameter_columns").value_or(NameMap{});
  keys.parameter_units = map.TextMap("parameter_units").value_or(NameMap{});
  keys.state_columns = map.TextMap("state_columns").value_or(NameMap{});
  keys.state_units = map.TextMap("state_units").value_or(NameMap{});
  keys.absolute = map.TextList("absolute").value_or(std::vector<std::string>{});
  map.Finish();
  return keys;
}

std::string ColumnOf(const NameMap& names, const std::string& name) {
  const std::string* column = FindName(names, name);
  return column != nullptr ? *column : name;
}

double FactorOf(const MapReader& map, const std::string& key, const NameMap& units,
                const std::string& name, const std::string& si_unit) {
  const std::string* text = FindName(units, name);
  if (text == nullptr) return 1;
  const auto unit = ParseUnit(*text);
  if (!unit.ok()) {
    map.Problem(key, absl::StrCat(name, ": ", std::string(unit.status().message())));
    return 1;
  }
  const auto wanted = ParseUnit(si_unit);
  if (wanted.ok() && !SameKind(unit->dimension, wanted->dimension)) {
    map.Problem(key, absl::StrCat(name, ": ", *text, " is ", KindOfUnit(*text), ", expected ",
                                  KindOfUnit(si_unit)));
  }
  return unit->factor;
}

std::unique_ptr<DataTable> OpenRunTable(const MapReader& map, const std::string& key,
                                        const std::string& path,
                                        const std::vector<std::string>& wanted,
                                        ReadContext& context) {
  if (path.empty()) return nullptr;
  const std::string* text = context.ReadNamedFile(map, key, path);
  if (text == nullptr) return nullptr;
  std::vector<TableProblem> found;
  TableFormat format;
  format.first_rules = context.by_first_rules();
  auto table = std::make_unique<DataTable>(*text, format, wanted, found);
  context.AddTableProblems(path, found);
  return found.empty() ? std::move(table) : nullptr;
}

std::vector<double> NumberColumn(const std::string& path, const DataTable& table,
                                 const std::string& column, ReadContext& context) {
  std::vector<TableProblem> found;
  std::vector<double> values = table.Column(column, found);
  context.AddTableProblems(path, found);
  return values;
}

std::vector<int> KeyColumn(const std::string& path, const DataTable& table,
                           const std::string& column, ReadContext& context) {
  std::vector<TableProblem> found;
  const std::vector<double> numbers = table.Column(column, found);
  std::vector<int> keys;
  constexpr double kLargest = 1e9;
  for (std::size_t i = 0; found.empty() && i < numbers.size(); ++i) {
    if (numbers[i] < 0 || numbers[i] > kLargest || numbers[i] != std::floor(numbers[i])) {
      found.push_back({table.LineOf(i), column,
                       absl::StrCat(numbers[i], " is not a whole number of at least 0")});
    }
    keys.push_back(static_cast<int>(numbers[i]));
  }
  context.AddTableProblems(path, found);
  return found.empty() ? keys : std::vector<int>();
}

}  // namespace calib::campaign
