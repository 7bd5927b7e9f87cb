#include "server/campaign/file/derived_columns.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "dem/formula/formula.h"

namespace calib::campaign {
namespace {

bool IsWordSign(char c, bool first) {
  const auto sign = static_cast<unsigned char>(c);
  return sign < 128 && (std::isalpha(sign) != 0 || c == '_' || (!first && std::isdigit(sign) != 0));
}

bool IsPlainWord(const std::string& text) {
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (!IsWordSign(text[i], i == 0)) return false;
  }
  return !text.empty() && text != "pi";
}

// What a column with this number is called where formulas are read.
std::string NameOfNumber(std::size_t number) { return absl::StrCat("column_number_", number); }

// The formula with a word in place of each $N.
std::string WithWords(const std::string& formula) {
  std::string text;
  for (std::size_t i = 0; i < formula.size(); ++i) {
    const bool number = formula[i] == '$' && i + 1 < formula.size() &&
                        std::isdigit(static_cast<unsigned char>(formula[i + 1])) != 0;
    text += number ? "column_number_" : std::string(1, formula[i]);
  }
  return text;
}

std::string WithNumbers(std::string text) {
  const std::string word = NameOfNumber(0).substr(0, NameOfNumber(0).size() - 1);
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word)) {
    text.replace(at, word.size(), "$");
  }
  return text;
}

struct SpokenColumns {
  std::vector<std::string> words;    // as a formula says them
  std::vector<std::string> columns;  // what they stand for in the table
};

SpokenColumns SpokenColumnsOf(const DataTable& table) {
  SpokenColumns names;
  const std::vector<std::string>& functions = dem::FormulaFunctions();
  for (std::size_t i = 0; i < table.columns().size(); ++i) {
    const std::string& column = table.columns()[i];
    names.words.push_back(NameOfNumber(i + 1));
    names.columns.push_back(column);
    const std::string word = NameWithoutUnit(column);
    const bool taken = std::find(functions.begin(), functions.end(), word) != functions.end() ||
                       std::find(names.words.begin(), names.words.end(), word) != names.words.end();
    if (!IsPlainWord(word) || taken || IndexOfColumn(table.columns(), word) < 0) continue;
    names.words.push_back(word);
    names.columns.push_back(column);
  }
  return names;
}

}  // namespace

DerivedColumns DerivedColumns::Read(MapReader& data) {
  DerivedColumns derived;
  if (const auto formulas = data.TextMap("formulas")) {
    derived.formulas_.insert(formulas->begin(), formulas->end());
  }
  return derived;
}

std::vector<std::string> DerivedColumns::Words() const {
  std::vector<std::string> words;
  for (const auto& [name, formula] : formulas_) {
    for (std::size_t i = 0; i < formula.size(); ++i) {
      const std::size_t begin = i;
      while (i < formula.size() && IsWordSign(formula[i], i == begin)) ++i;
      if (i > begin) words.push_back(formula.substr(begin, i - begin));
    }
  }
  return words;
}

void DerivedColumns::Compute(const MapReader& data, const std::string& path, const DataTable& table,
                             ReadContext& context) {
  const SpokenColumns names = SpokenColumnsOf(table);
  for (const auto& [name, formula] : formulas_) {
    const std::string key = "formulas." + name;
    if (table.Has(name)) {
      data.problems().Add(data.LineOf("formulas"), data.PathOf(key),
                          absl::StrCat("is a column of ", path, " already; take another name"));
      continue;
    }
    const std::string text = WithWords(formula);
    if (const auto problem = dem::Formula::Check(text, names.words); !problem.message.empty()) {
      data.problems().Add(data.LineOf("formulas"), data.PathOf(key),
                          absl::StrCat(WithNumbers(problem.message),
                                       "; a formula speaks of columns by $N or by a plain name"));
      continue;
    }
    const dem::Formula parsed(text, names.words);
    std::vector<std::vector<double>> columns;
    std::vector<TableProblem> found;
    for (const int used : parsed.used()) {
      columns.push_back(table.ColumnWithGaps(names.columns[static_cast<std::size_t>(used)], found));
    }
    context.AddTableProblems(path, found);
    std::vector<double>& values = values_[name];
    for (std::size_t i = 0; i < table.rows(); ++i) {
      std::vector<double> row;
      row.reserve(columns.size());
      for (const std::vector<double>& column : columns) row.push_back(column[i]);
      double value = 0;
      parsed.Evaluate(row.data(), 1, &value);
      const bool known =
          std::all_of(row.begin(), row.end(), [](double x) { return !std::isnan(x); });
      values.push_back(known ? value : std::nan(""));
      if (!known || std::isfinite(value) || !found.empty()) continue;
      found.push_back({table.LineOf(i), name, "the formula gives no finite number here"});
      context.AddTableProblems(path, found);
    }
  }
}

}  // namespace calib::campaign
