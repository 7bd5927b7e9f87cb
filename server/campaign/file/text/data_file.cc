#include "server/campaign/file/text/data_file.h"

#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "server/campaign/file/text/encoding.h"
#include "server/campaign/file/text/suggestion.h"

namespace calib::campaign {
namespace {

constexpr int kMostProblemsPerColumn = 5;

}  // namespace

DataTable::DataTable(const std::string& bytes, const TableFormat& format,
                     const std::vector<std::string>& wanted, std::vector<TableProblem>& problems)
    : missing_(format.missing) {
  const DecodedText decoded = DecodeText(bytes);
  if (!decoded.problem.empty()) {
    problems.push_back({0, "", decoded.problem, "encoding"});
    return;
  }
  layout_ = FindLayout(decoded.text, format, wanted, problems);
}

bool DataTable::Has(const std::string& column) const {
  return IndexOfColumn(columns(), column) >= 0;
}

std::string DataTable::UnitOf(const std::string& column) const {
  const std::ptrdiff_t index = IndexOfColumn(columns(), column);
  return index >= 0 ? UnitInName(columns()[static_cast<std::size_t>(index)]) : "";
}

std::vector<double> DataTable::Column(const std::string& name,
                                      std::vector<TableProblem>& problems) const {
  return Read(name, false, problems);
}

std::vector<double> DataTable::ColumnWithGaps(const std::string& name,
                                              std::vector<TableProblem>& problems) const {
  return Read(name, true, problems);
}

std::vector<double> DataTable::Read(const std::string& name, bool gaps,
                                    std::vector<TableProblem>& problems) const {
  std::vector<double> values(rows(), std::numeric_limits<double>::quiet_NaN());
  const std::ptrdiff_t index = IndexOfColumn(columns(), name);
  if (index < 0) {
    problems.push_back({layout_.header_line, name,
                        index == -1 ? "is not a column of this file; " + Suggestion(name, columns())
                                    : "is the name of more than one column"});
    return values;
  }
  const auto at = static_cast<std::size_t>(index);
  int bad = 0;
  for (std::size_t i = 0; i < rows(); ++i) {
    const TableRow& row = layout_.rows[i];
    const std::string field = at < row.cells.size() ? row.cells[at] : "";
    const auto number = NumberIn(field, layout_.mark);
    std::string what;
    if (gaps && SaysMissing(field, missing_)) continue;
    if (number && std::isfinite(*number)) {
      values[i] = *number;
    } else if (at >= row.cells.size()) {
      what = absl::StrCat("is missing: the line has ", row.cells.size(), " of ", columns().size(),
                          " fields");
    } else if (field.empty()) {
      what = "is empty, expected a number";
    } else if (!number) {
      what = Quoted(field) + " is not a number";
      if (gaps) what += "; if nothing was measured there, say so: missing: [" + Quoted(field) + "]";
    } else {
      what = Quoted(field) + " is not a finite number";
    }
    if (!what.empty() && ++bad <= kMostProblemsPerColumn)
      problems.push_back({row.line, name, what});
  }
  if (bad > kMostProblemsPerColumn) {
    problems.push_back(
        {0, name, absl::StrCat("has ", bad - kMostProblemsPerColumn, " more bad fields")});
  }
  return values;
}

std::vector<std::string> DataTable::Texts(const std::string& name) const {
  const std::ptrdiff_t index = IndexOfColumn(columns(), name);
  std::vector<std::string> texts;
  if (index < 0) return texts;
  for (const TableRow& row : layout_.rows) {
    const auto at = static_cast<std::size_t>(index);
    texts.emplace_back(at < row.cells.size() ? row.cells[at] : "");
  }
  return texts;
}

}  // namespace calib::campaign
