#include "server/campaign/file/text/table_layout.h"

#include <algorithm>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/file/text/table_lines.h"

namespace calib::campaign {
namespace {

std::size_t WidthOf(const std::vector<std::string>& cells) {
  std::size_t width = cells.size();
  while (width > 0 && cells[width - 1].empty()) --width;
  return width;
}

bool SameCell(const std::string& cell, const std::string& wanted) {
  if (cell == wanted) return true;
  const auto a = NumberIn(cell, DecimalMark::kPoint);
  const auto b = NumberIn(wanted, DecimalMark::kPoint);
  return a && b && *a == *b;
}

// One way of parting the cells, tried on the whole text.
class Trial {
 public:
  Trial(const std::vector<TableLine>& lines, const TableFormat& format,
        const std::vector<std::string>& wanted, Parting parting)
      : lines_(lines), format_(format), wanted_(wanted) {
    layout_.parting = parting;
    for (const TableLine& line : lines_) cells_.push_back(CellsOf(line.content, parting));
    layout_.mark = format_.decimal.value_or(FoundMark());
    if (!format_.where.empty()) {
      ReadWhere();
    } else if (format_.header) {
      ReadBelowHeader();
    } else {
      TakeRowsFrom(0);
      for (std::size_t i = 1; i <= widest_; ++i) layout_.columns.push_back(absl::StrCat(i));
    }
  }

  [[nodiscard]] bool HasRows() const { return !layout_.rows.empty(); }
  [[nodiscard]] bool Fits() const { return HasRows() && problem_.message.empty(); }
  [[nodiscard]] const TableProblem& problem() const { return problem_; }
  TableLayout& layout() { return layout_; }

  // Share of cells that say something which is no number.
  [[nodiscard]] double Foreign() const {
    std::size_t all = 0;
    std::size_t foreign = 0;
    for (const TableRow& row : layout_.rows) {
      for (const std::string& cell : row.cells) {
        ++all;
        foreign += IsNumber(cell) || SaysMissing(cell, format_.missing) ? 0 : 1;
      }
    }
    return all > 0 ? static_cast<double>(foreign) / static_cast<double>(all) : 1;
  }

 private:
  [[nodiscard]] bool IsNumber(const std::string& cell) const {
    return NumberIn(cell, layout_.mark).has_value();
  }

  [[nodiscard]] DecimalMark FoundMark() const {
    bool comma = false;
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      if (lines_[i].comment) continue;
      for (const std::string& cell : cells_[i]) {
        comma = comma || HasDecimalComma(cell);
        if (cell.find('.') != std::string::npos && NumberIn(cell, DecimalMark::kPoint)) {
          return DecimalMark::kPoint;
        }
      }
    }
    return comma ? DecimalMark::kComma : DecimalMark::kPoint;
  }

  // Where cells may be empty a row has as many as it has signs, but for empty ones at its end.
  [[nodiscard]] bool MayBeEmpty() const { return layout_.parting != Parting::kBlanks; }

  [[nodiscard]] bool BeginsRows(std::size_t i) const {
    if (lines_[i].comment || cells_[i].empty()) return false;
    const auto numbers = std::count_if(cells_[i].begin(), cells_[i].end(),
                                       [this](const auto& cell) { return IsNumber(cell); });
    const auto filled = std::count_if(cells_[i].begin(), cells_[i].end(), [this](const auto& cell) {
      return !SaysMissing(cell, format_.missing);
    });
    return IsNumber(cells_[i].front()) || 2 * numbers > filled;
  }

  void TakeRow(std::size_t i) {
    widest_ = std::max(widest_, WidthOf(cells_[i]));
    longest_ = std::max(longest_, cells_[i].size());
    layout_.rows.push_back({lines_[i].number, cells_[i]});
  }

  void TakeRowsFrom(std::size_t first) {
    for (std::size_t i = first; i < lines_.size(); ++i) {
      if (BeginsRows(i)) widest_ = std::max(widest_, WidthOf(cells_[i]));
    }
    const std::size_t width = widest_;
    for (std::size_t i = first; i < lines_.size(); ++i) {
      const bool as_long = HasRows() && !lines_[i].comment && WidthOf(cells_[i]) == width;
      if (BeginsRows(i) || as_long) TakeRow(i);
    }
  }

  // Names of a line if they can be those of the rows; empty: they cannot.
  [[nodiscard]] std::vector<std::string> NamesFitting(const TableLine& line) const {
    for (const Parting parting :
         {layout_.parting, Parting::kGaps, Parting::kBlanks, Parting::kUnits, Parting::kUnitEnds,
          Parting::kCommas, Parting::kSemicolons}) {
      std::vector<std::string> names = NamesOf(line, parting);
      const bool as_before = format_.first_rules && parting == layout_.parting;
      // Commas that part cells stand in no name, and commas that part names in no number.
      const bool rows_by_commas =
          layout_.parting == Parting::kCommas && parting != Parting::kCommas;
      const bool commas_part =
          (rows_by_commas || (layout_.mark == DecimalMark::kComma && !format_.decimal)) &&
          std::any_of(names.begin(), names.end(),
                      [](const auto& name) { return name.find(',') != std::string::npos; });
      if (commas_part) continue;
      if (names.size() >= widest_ && (names.size() <= longest_ || as_before)) return names;
    }
    return {};
  }

  static std::vector<std::string> NamesOf(const TableLine& line, Parting parting) {
    std::vector<std::string> names =
        CellsOf(line.comment ? line.content : WithoutCommentSigns(Trimmed(line.content)), parting);
    names.resize(WidthOf(names));
    return names;
  }

  [[nodiscard]] std::ptrdiff_t Named(const std::vector<std::string>& names) const {
    return std::count_if(wanted_.begin(), wanted_.end(), [&names](const std::string& name) {
      return IndexOfColumn(names, name) >= 0;
    });
  }

  void ReadBelowHeader() {
    std::size_t first = 0;
    if (format_.skip > 0 && !lines_.empty()) {
      first = 1;
    } else {
      while (first < lines_.size() && !BeginsRows(first)) ++first;
    }
    TakeRowsFrom(first);
    if (!HasRows()) return;
    while (first < lines_.size() && lines_[first].number < layout_.rows.front().line) ++first;
    const std::size_t above = format_.skip > 0 ? 1 : first;
    std::ptrdiff_t best = -1;
    for (std::size_t i = 0; i < above; ++i) {
      const std::vector<std::string> names = NamesFitting(lines_[i]);
      if (names.empty()) continue;
      const std::ptrdiff_t score = 2 * Named(names) + (lines_[i].comment ? 0 : 1);
      if (score < best || (score == best && !lines_[i].comment)) continue;
      best = score;
      layout_.header_line = lines_[i].number;
      layout_.columns = names;
    }
    if (best < 0) {
      SayWhyNoHeader(above);
    } else {
      CheckLengths();
    }
  }

  void SayWhyNoHeader(std::size_t above) {
    const TableLine* guess = nullptr;
    for (std::size_t i = 0; i < above; ++i) {
      const bool named = Named(NamesOf(lines_[i], Parting::kUnits)) > 0;
      if (guess == nullptr && (!lines_[i].comment || named)) guess = &lines_[i];
    }
    if (guess == nullptr) {
      problem_ = {layout_.rows.front().line, "",
                  "has no header line above the first row that names the columns"};
      return;
    }
    const auto widest =
        std::find_if(layout_.rows.begin(), layout_.rows.end(),
                     [this](const TableRow& row) { return WidthOf(row.cells) == widest_; });
    const std::size_t names = NamesOf(*guess, layout_.parting).size();
    problem_ = {
        widest->line, "",
        absl::StrCat("has ", widest_, " fields, but the header in line ", guess->number, " names ",
                     names, " columns",
                     names > widest_ ? "; part names that hold blanks by tabs or two blanks" : ""),
        "columns"};
  }

  void CheckLengths() {
    if (MayBeEmpty() || format_.first_rules) return;
    for (const TableRow& row : layout_.rows) {
      if (row.cells.size() == layout_.columns.size()) continue;
      problem_ = {row.line, "",
                  absl::StrCat("has ", row.cells.size(), " fields, but the header in line ",
                               layout_.header_line, " names ", layout_.columns.size(),
                               " columns; write NaN where nothing was measured, or part the cells "
                               "by tabs or commas"),
                  "columns"};
      return;
    }
  }

  void ReadWhere() {
    std::size_t header = lines_.size();
    std::ptrdiff_t best = -1;
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      const std::vector<std::string> names = NamesOf(lines_[i], layout_.parting);
      const bool all = std::all_of(format_.where.begin(), format_.where.end(), [&](const auto& w) {
        return IndexOfColumn(names, w.first) >= 0;
      });
      if (!all || Named(names) <= best) continue;
      best = Named(names);
      header = i;
      layout_.columns = names;
      layout_.header_line = lines_[i].number;
    }
    if (header == lines_.size()) return;
    std::vector<std::string> others;  // what stands in the columns instead
    for (std::size_t i = header + 1; i < lines_.size(); ++i) {
      if (lines_[i].comment) continue;
      const bool all = std::all_of(format_.where.begin(), format_.where.end(), [&](const auto& w) {
        const auto at = static_cast<std::size_t>(IndexOfColumn(layout_.columns, w.first));
        return at < cells_[i].size() && SameCell(cells_[i][at], w.second);
      });
      if (all) TakeRow(i);
    }
    if (HasRows() && widest_ > layout_.columns.size()) {
      problem_ = {layout_.rows.front().line, "",
                  absl::StrCat("has ", widest_, " fields, but the header in line ",
                               layout_.header_line, " names ", layout_.columns.size(), " columns"),
                  "columns"};
    }
  }

  const std::vector<TableLine>& lines_;
  const TableFormat& format_;
  const std::vector<std::string>& wanted_;
  std::vector<std::vector<std::string>> cells_;  // of each line
  TableLayout layout_;
  std::size_t widest_ = 0;   // cells of a row without empty ones at its end
  std::size_t longest_ = 0;  // with them
  TableProblem problem_;
};

std::vector<Parting> Possible(const std::vector<TableLine>& lines, const TableFormat& format) {
  if (format.parting) return {*format.parting};
  std::vector<Parting> possible;
  const auto stands = [&lines](char sign) {
    return std::any_of(lines.begin(), lines.end(), [sign](const TableLine& line) {
      return !line.comment && line.content.find(sign) != std::string_view::npos;
    });
  };
  if (stands(';')) possible.push_back(Parting::kSemicolons);
  // Commas part cells and fractions only where the cells are quoted.
  if (stands(',') && (format.decimal != DecimalMark::kComma || stands('"'))) {
    possible.push_back(Parting::kCommas);
  }
  possible.push_back(Parting::kBlanks);
  if (stands('\t')) possible.push_back(Parting::kTabs);
  return possible;
}

// A comma in a number may part its fraction or its thousands; where it is said which, or one number
// shows it, all are read alike.
void CheckCommas(const TableLayout& layout, const TableFormat& format,
                 std::vector<TableProblem>& problems) {
  const bool csv = layout.parting == Parting::kCommas && layout.mark == DecimalMark::kPoint;
  if (format.decimal || csv) return;
  const TableRow* first = nullptr;
  std::string cell_of_first;
  for (const TableRow& row : layout.rows) {
    for (const std::string& cell : row.cells) {
      if (!HasDecimalComma(cell) && !MayHoldThousands(cell)) continue;
      if (layout.mark == DecimalMark::kPoint) {
        problems.push_back({row.line, "",
                            absl::StrCat("has ", Quoted(cell),
                                         ", a number with a comma, beside numbers with a point: "
                                         "write one decimal sign throughout")});
        return;
      }
      if (!MayHoldThousands(cell)) return;
      if (first == nullptr) {
        first = &row;
        cell_of_first = cell;
      }
    }
  }
  if (first == nullptr) return;
  problems.push_back({first->line, "",
                      absl::StrCat("has ", Quoted(cell_of_first),
                                   ", whose comma may part a fraction or thousands: say which, "
                                   "decimal: comma or decimal: point with plain numbers")});
}

void SayWhyNoRows(const TableFormat& format, std::vector<TableProblem>& problems) {
  std::string message = "holds no rows of numbers";
  for (std::size_t i = 0; i < format.where.size(); ++i) {
    absl::StrAppend(&message, i == 0 ? " with " : " and ", format.where[i].first, " ",
                    format.where[i].second);
  }
  problems.push_back({0, "", message});
}

void Choose(const TableFormat& format, TableLayout& layout, std::vector<TableProblem>& problems) {
  if (format.first_row == 1 && !format.last_row) return;
  const std::size_t all = layout.rows.size();
  const std::size_t last =
      std::min(all, static_cast<std::size_t>(format.last_row.value_or(static_cast<int>(all))));
  const auto first = static_cast<std::size_t>(format.first_row);
  if (first > last || static_cast<std::size_t>(format.last_row.value_or(1)) > all) {
    problems.push_back({0, "", absl::StrCat("has ", all, " rows; rows names others")});
    return;
  }
  layout.rows = {layout.rows.begin() + static_cast<std::ptrdiff_t>(first - 1),
                 layout.rows.begin() + static_cast<std::ptrdiff_t>(last)};
}

}  // namespace

TableLayout FindLayout(const std::string& text, const TableFormat& format,
                       const std::vector<std::string>& wanted,
                       std::vector<TableProblem>& problems) {
  const std::vector<TableLine> lines = LinesOf(text, format.skip);
  std::vector<Trial> trials;
  for (const Parting parting : Possible(lines, format)) {
    trials.emplace_back(lines, format, wanted, parting);
  }
  const auto best =
      std::min_element(trials.begin(), trials.end(), [](const Trial& a, const Trial& b) {
        if (a.Fits() != b.Fits()) return a.Fits();
        return a.Foreign() < b.Foreign();
      });
  if (!best->HasRows()) {
    SayWhyNoRows(format, problems);
    return {};
  }
  if (!best->Fits()) {
    problems.push_back(best->problem());
    return {};
  }
  TableLayout layout = std::move(best->layout());
  CheckCommas(layout, format, problems);
  Choose(format, layout, problems);
  return layout;
}

std::string UnitInName(const std::string& column) {
  for (const auto& [open, close] : {std::pair('(', ')'), std::pair('[', ']')}) {
    const std::size_t at = column.rfind(open);
    if (!column.empty() && column.back() == close && at != std::string::npos && at > 0) {
      return column.substr(at + 1, column.size() - at - 2);
    }
  }
  return "";
}

std::string NameWithoutUnit(const std::string& column) {
  const std::string unit = UnitInName(column);
  if (unit.empty()) return column;
  const std::string_view name(column.data(), column.size() - unit.size() - 2);
  return std::string(Trimmed(name));
}

std::ptrdiff_t IndexOfColumn(const std::vector<std::string>& columns, const std::string& name) {
  constexpr std::ptrdiff_t kNone = -1;
  constexpr std::ptrdiff_t kSeveral = -2;
  const auto only = [&columns](const auto& is) -> std::ptrdiff_t {
    const auto at = std::find_if(columns.begin(), columns.end(), is);
    if (at == columns.end()) return kNone;
    return std::find_if(at + 1, columns.end(), is) == columns.end() ? at - columns.begin()
                                                                    : kSeveral;
  };
  const std::ptrdiff_t exact = only([&name](const std::string& c) { return c == name; });
  if (exact != kNone) return exact;
  return only([&name](const std::string& c) { return NameWithoutUnit(c) == name; });
}

}  // namespace calib::campaign
