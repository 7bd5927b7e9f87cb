#include "server/inspection/inspected_table.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string_view>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "server/campaign/file/text/encoding.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/file/text/table_lines.h"
#include "server/inspection/header_words.h"

namespace calib::inspection {
namespace {

using campaign::DecimalMark;
using campaign::NumberIn;
using campaign::Parting;
using campaign::TableFormat;
using campaign::TableLayout;
using campaign::TableLine;
using campaign::TableProblem;

// Rows of a test on average, for a column to name tests by it. Chosen: a curve has three points.
constexpr std::size_t kLeastRowsOfATest = 3;
constexpr std::size_t kMostTests = 10000;  // Chosen: beyond any collection of tests

bool IsNumberSomehow(const std::string& cell) {
  return NumberIn(cell, DecimalMark::kPoint) || campaign::HasDecimalComma(cell);
}

std::vector<std::string> WithoutEmptyEnd(std::vector<std::string> cells) {
  while (!cells.empty() && cells.back().empty()) cells.pop_back();
  return cells;
}

// "2024-05-01", "1.5.2024", "5/1/24", with a time behind it or none.
bool IsDate(const std::string& cell) {
  const std::string day = cell.substr(0, cell.find_first_of(" T"));
  const std::size_t sign = day.find_first_of("-./");
  if (sign == std::string::npos || sign == 0) return false;
  const std::size_t next = day.find(day[sign], sign + 1);
  if (next == std::string::npos || day.find(day[sign], next + 1) != std::string::npos) return false;
  return std::all_of(day.begin(), day.end(), [&day, sign](unsigned char c) {
    return std::isdigit(c) != 0 || c == static_cast<unsigned char>(day[sign]);
  });
}

bool IsKnownHeading(const std::string& cell) {
  if (cell.empty() || IsNumberSomehow(cell)) return false;
  return !ReadHeader(campaign::NameWithoutUnit(cell), campaign::UnitInName(cell))
              .candidates.empty();
}

// --- stacked sections

// Lines of one table within a text: its header and rows.
struct Block {
  std::size_t header = 0;  // index of the line; only if named
  bool named = false;
  std::vector<std::string> names{};
  std::string title{};  // the line above, where it is none of the table
  std::vector<std::size_t> rows{};
  std::size_t numbers = 0;  // cells
};

class Sections {
 public:
  Sections(const std::vector<TableLine>& lines, Parting parting)
      : lines_(lines), parting_(parting) {
    std::vector<std::size_t> above;  // lines since the last row
    for (std::size_t i = 0; i < lines.size(); ++i) {
      if (!IsRow(i)) {
        above.push_back(i);
        continue;
      }
      const auto cells = WithoutEmptyEnd(campaign::CellsOf(lines[i].content, parting));
      if (!above.empty() || blocks_.empty()) Begin(above, cells.size());
      above.clear();
      blocks_.back().rows.push_back(i);
      blocks_.back().numbers +=
          static_cast<std::size_t>(std::count_if(cells.begin(), cells.end(), &IsNumberSomehow));
    }
  }

  [[nodiscard]] const std::vector<Block>& blocks() const { return blocks_; }

 private:
  [[nodiscard]] bool IsRow(std::size_t i) const {
    if (lines_[i].comment) return false;
    const auto cells = campaign::CellsOf(lines_[i].content, parting_);
    const auto numbers = std::count_if(cells.begin(), cells.end(), &IsNumberSomehow);
    const auto filled = std::count_if(cells.begin(), cells.end(), [](const std::string& cell) {
      return !campaign::SaysMissing(cell, {});
    });
    return (!cells.empty() && IsNumberSomehow(cells.front())) || 2 * numbers > filled;
  }

  // A new table begins where lines without numbers name as many columns as the next row has.
  void Begin(const std::vector<std::size_t>& above, std::size_t width) {
    const std::vector<Parting> partings =
        parting_ == Parting::kBlanks || parting_ == Parting::kTabs
            ? std::vector{parting_, Parting::kGaps, Parting::kUnits, Parting::kUnitEnds}
            : std::vector{parting_};
    std::optional<Block> best;
    std::ptrdiff_t most = -1;  // names that are known
    for (std::size_t k = 0; k < above.size(); ++k) {
      const TableLine& line = lines_[above[k]];
      if (line.comment) continue;
      for (const Parting parting : partings) {
        const auto names = WithoutEmptyEnd(campaign::CellsOf(line.content, parting));
        if (names.size() < width || width < 2) continue;
        const auto known = std::count_if(names.begin(), names.end(), &IsKnownHeading);
        if (known <= most) continue;
        most = known;
        best = Block{.header = above[k], .named = true, .names = names};
        if (k > 0) best->title = std::string(campaign::Trimmed(lines_[above[k - 1]].content));
      }
    }
    if (best) {
      blocks_.push_back(*std::move(best));
    } else if (blocks_.empty()) {
      blocks_.emplace_back();
    }
  }

  const std::vector<TableLine>& lines_;
  Parting parting_;
  std::vector<Block> blocks_;
};

Parting LikelyParting(const std::vector<TableLine>& lines) {
  const auto share = [&lines](char sign) {
    return std::count_if(lines.begin(), lines.end(), [sign](const TableLine& line) {
      return line.content.find(sign) != std::string_view::npos;
    });
  };
  const auto half = static_cast<std::ptrdiff_t>(lines.size() / 2);
  if (share(';') > half) return Parting::kSemicolons;
  if (share('\t') > half) return Parting::kTabs;
  if (share(',') > half) return Parting::kCommas;
  return Parting::kBlanks;
}

// --- what a layout says, as columns

std::string NameFor(const std::vector<std::string>& headers, std::size_t at) {
  const std::string name = campaign::NameWithoutUnit(headers[at]);
  return campaign::IndexOfColumn(headers, name) == static_cast<std::ptrdiff_t>(at) ? name
                                                                                   : headers[at];
}

std::vector<InspectedColumn> ColumnsOf(const TableLayout& layout, const TableFormat& format) {
  std::vector<InspectedColumn> columns;
  for (std::size_t at = 0; at < layout.columns.size(); ++at) {
    InspectedColumn column{.name = NameFor(layout.columns, at),
                           .header = layout.columns[at],
                           .unit = campaign::UnitInName(layout.columns[at])};
    for (const campaign::TableRow& row : layout.rows) {
      const std::string cell = at < row.cells.size() ? row.cells[at] : "";
      const auto number = NumberIn(cell, layout.mark);
      const bool missing = campaign::SaysMissing(cell, format.missing);
      column.missing += missing ? 1 : 0;
      column.texts += !missing && !number ? 1 : 0;
      column.dates += !missing && !number && IsDate(cell) ? 1 : 0;
      column.values.push_back(!missing && number && std::isfinite(*number)
                                  ? *number
                                  : std::numeric_limits<double>::quiet_NaN());
    }
    columns.push_back(std::move(column));
  }
  return columns;
}

// Lines between the header and the first row that say a unit for each column.
void TakeUnitLine(const std::vector<TableLine>& lines, const TableLayout& layout,
                  std::vector<InspectedColumn>& columns, std::vector<std::string>& remarks) {
  const int first = layout.rows.empty() ? 0 : layout.rows.front().line;
  for (const TableLine& line : lines) {
    if (line.number >= first || line.number == layout.header_line) continue;
    if (line.number > layout.header_line && layout.header_line > 0) {
      bool taken = false;
      for (const Parting parting : {layout.parting, Parting::kGaps, Parting::kBlanks}) {
        const auto cells = WithoutEmptyEnd(campaign::CellsOf(line.content, parting));
        if (cells.size() != columns.size() ||
            !std::all_of(cells.begin(), cells.end(), &IsWrittenUnit)) {
          continue;
        }
        for (std::size_t i = 0; i < cells.size(); ++i) {
          if (columns[i].unit.empty()) columns[i].unit = WithoutBrackets(cells[i]);
        }
        taken = true;
        break;
      }
      if (taken) continue;
    }
    remarks.emplace_back(campaign::Trimmed(line.content));
  }
}

// Rows of a layout by the texts of one column, in order of first mention.
std::vector<std::pair<std::string, std::size_t>> Groups(const TableLayout& layout, std::size_t at) {
  std::vector<std::pair<std::string, std::size_t>> groups;
  std::map<std::string, std::size_t> known;
  for (const campaign::TableRow& row : layout.rows) {
    const std::string cell = at < row.cells.size() ? row.cells[at] : "";
    const auto [place, fresh] = known.emplace(cell, groups.size());
    if (fresh) groups.emplace_back(cell, 0);
    ++groups[place->second].second;
  }
  return groups;
}

// Whether equal cells of a column stand together.
bool StandTogether(const TableLayout& layout, std::size_t at, std::size_t groups) {
  std::size_t runs = 0;
  const std::string* last = nullptr;
  for (const campaign::TableRow& row : layout.rows) {
    if (at >= row.cells.size()) return false;
    if (last == nullptr || *last != row.cells[at]) ++runs;
    last = &row.cells[at];
  }
  return runs == groups;
}

// Whether tabs part the cells of all rows, which the reader counts among blanks.
bool HasTabs(const std::vector<TableLine>& lines, const TableLayout& layout) {
  std::set<int> rows;
  for (const campaign::TableRow& row : layout.rows) rows.insert(row.line);
  return std::all_of(lines.begin(), lines.end(), [&rows](const TableLine& line) {
    return !rows.contains(line.number) ||
           campaign::Trimmed(line.content).find('\t') != std::string_view::npos;
  });
}

// A column of words, or of whole numbers under a heading that says so, each over rows that stand
// together: it names the tests, or their stages.
std::optional<std::size_t> NamingColumn(const TableLayout& layout,
                                        const std::vector<InspectedColumn>& columns) {
  std::optional<std::size_t> best;
  for (std::size_t at = 0; at < columns.size(); ++at) {
    const InspectedColumn& column = columns[at];
    const bool words = column.texts == static_cast<int>(layout.rows.size()) && column.dates == 0;
    const bool says_so = SaysTestName(column.name);
    const bool whole = std::all_of(column.values.begin(), column.values.end(),
                                   [](double v) { return v == std::floor(v); });
    if (!words && !(says_so && whole && column.missing == 0)) continue;
    const auto groups = Groups(layout, at);
    if (groups.size() < 2 || groups.size() > kMostTests ||
        layout.rows.size() < kLeastRowsOfATest * groups.size() ||
        !StandTogether(layout, at, groups.size())) {
      continue;
    }
    if (!best || (says_so && !SaysTestName(columns[*best].name))) best = at;
  }
  return best;
}

// Cells of the text's words that name quantities: of several lines that may be the header the one
// with most of them is.
std::vector<std::string> KnownHeadings(const std::vector<TableLine>& lines) {
  constexpr std::size_t kMostLines = 200;  // looked at
  std::set<std::string> known;
  for (std::size_t i = 0; i < std::min(lines.size(), kMostLines); ++i) {
    for (const Parting parting : {LikelyParting(lines), Parting::kGaps, Parting::kUnits}) {
      for (const std::string& cell : campaign::CellsOf(lines[i].content, parting)) {
        if (IsKnownHeading(cell)) known.insert(cell);
      }
    }
  }
  return {known.begin(), known.end()};
}

TableLayout LayoutOf(const std::string& text, const TableFormat& format,
                     const std::vector<std::string>& wanted, std::vector<TableProblem>& problems) {
  return campaign::FindLayout(text, format, wanted, problems);
}

InspectedPart PartOf(const TableLayout& layout, const TableFormat& format,
                     const std::string& name) {
  InspectedPart part{.name = name, .format = format};
  part.columns = ColumnsOf(layout, format);
  for (const campaign::TableRow& row : layout.rows) part.lines.push_back(row.line);
  return part;
}

// Tables of one header that follow each other, or the largest of several; empty: the text is one
// table.
struct Choice {
  TableFormat format{};
  std::string title{};
};
std::vector<Choice> StackedChoices(const std::vector<TableLine>& lines) {
  const Sections sections(lines, LikelyParting(lines));
  std::vector<const Block*> named;
  for (const Block& block : sections.blocks()) {
    if (block.named && block.rows.size() > 1) named.push_back(&block);
  }
  if (named.size() < 2) return {};
  const Block& largest =
      **std::max_element(named.begin(), named.end(),
                         [](const Block* a, const Block* b) { return a->numbers < b->numbers; });
  std::vector<Choice> choices;
  for (const Block* block : named) {
    if (block->names != largest.names) continue;
    // The reader counts rows behind the header to the end of the text, ours are the first of them.
    Choice choice{.title = block->title};
    choice.format.skip = lines[block->header].number - 1;
    choice.format.last_row = static_cast<int>(block->rows.size());
    if (choice.title.empty()) choice.title = absl::StrCat("section ", choices.size() + 1);
    choices.push_back(choice);
  }
  return choices;
}

}  // namespace

InspectedTable ReadInspectedTable(const std::string& bytes, std::vector<TableProblem>& problems) {
  InspectedTable table;
  const campaign::DecodedText decoded = campaign::DecodeText(bytes);
  if (!decoded.problem.empty()) {
    problems.push_back({0, "", decoded.problem, "encoding"});
    return table;
  }
  table.encoding = decoded.encoding;
  const std::vector<TableLine> lines = campaign::LinesOf(decoded.text, 0);
  if (lines.empty()) {
    problems.push_back({0, "", "is empty"});
    return table;
  }
  const std::vector<std::string> known = KnownHeadings(lines);
  std::vector<Choice> choices = StackedChoices(lines);
  const bool stacked = choices.size() > 1;
  if (choices.empty()) choices.emplace_back();
  for (Choice& choice : choices) {
    std::vector<TableProblem> found;
    TableLayout layout = LayoutOf(decoded.text, choice.format, known, found);
    const bool nameless = choice.format.skip == 0 && !found.empty() && layout.rows.empty();
    if (nameless) {
      std::vector<TableProblem> without;
      TableFormat plain = choice.format;
      plain.header = false;
      TableLayout second = LayoutOf(decoded.text, plain, {}, without);
      // Names of other lengths than the rows are a mistake to be told, not the absence of names.
      const bool names_misfit = std::any_of(found.begin(), found.end(), [](const auto& problem) {
        return problem.kind == "columns";
      });
      if (without.empty() && !names_misfit) {
        choice.format = plain;
        layout = std::move(second);
        found.clear();
      }
    }
    if (!found.empty()) {
      problems.insert(problems.end(), found.begin(), found.end());
      return table;
    }
    InspectedPart part = PartOf(layout, choice.format, stacked ? choice.title : "");
    std::vector<std::string> remarks;
    TakeUnitLine(lines, layout, part.columns, remarks);
    if (table.parts.empty()) {
      table.parting = layout.parting == Parting::kBlanks && HasTabs(lines, layout) ? Parting::kTabs
                                                                                   : layout.parting;
      table.mark = layout.mark;
      table.header_lines = layout.rows.front().line - 1;
      table.remarks = remarks;
    }
    const auto naming = stacked ? std::nullopt : NamingColumn(layout, part.columns);
    if (!naming) {
      table.parts.push_back(std::move(part));
      continue;
    }
    table.naming_column = part.columns[*naming].name;
    table.names_stages = SaysStage(table.naming_column);
    // By its word alone the reader finds these rows, wherever in the file they stand.
    for (const auto& [word, rows] : Groups(layout, *naming)) {
      TableLayout own = layout;
      std::erase_if(own.rows, [at = *naming, &w = word](const campaign::TableRow& row) {
        return at >= row.cells.size() || row.cells[at] != w;
      });
      TableFormat format;
      format.where = {{table.naming_column, word}};
      InspectedPart one = PartOf(own, format, word);
      for (std::size_t i = 0; i < one.columns.size(); ++i) {
        one.columns[i].unit = part.columns[i].unit;
      }
      table.parts.push_back(std::move(one));
    }
  }
  return table;
}

}  // namespace calib::inspection
