#pragma once
// Where in a text the table stands: what parts its cells, which line names its columns, which lines
// are its rows.

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/campaign/file/text/table_cells.h"

namespace calib::campaign {

/// One thing wrong in a table. line is 1-based; 0: the file as a whole. column may be empty. kind:
/// "columns" (row lengths that no reading explains), "encoding", or empty.
struct TableProblem {
  int line = 0;
  std::string column;
  std::string message;
  std::string kind = {};
};

/// What is said of a table's form; the rest is found.
struct TableFormat {
  std::optional<Parting> parting;
  std::optional<DecimalMark> decimal;
  int skip = 0;        ///< lines before the header
  bool header = true;  ///< false: columns are called 1, 2, ...
  int first_row = 1;   ///< of the rows of numbers, from 1
  std::optional<int> last_row;
  /// Only rows with these texts (or numbers) in these columns.
  std::vector<std::pair<std::string, std::string>> where;
  std::vector<std::string> missing;  ///< words that say that nothing was measured
  /// Names are parted as the rows are, which may be shorter than the header: for campaigns that
  /// were accepted so.
  bool first_rules = false;
};

struct TableRow {
  int line = 0;
  std::vector<std::string> cells;
};

struct TableLayout {
  Parting parting = Parting::kBlanks;
  DecimalMark mark = DecimalMark::kPoint;
  int header_line = 0;  ///< 0: none
  std::vector<std::string> columns;
  std::vector<TableRow> rows;
};

/// A row is a line that begins with a number or is numbers for the greater part; behind the first
/// row also one of as many cells as the rows have. Lines of neither kind are passed over: titles,
/// units, remarks (#). Of the ways in which the cells may be parted the one is taken under which
/// the rows are as long as the header, and most cells numbers. The header is the line above the
/// rows that does so and names most of `wanted`: the first of the plain ones, the last of the
/// comments. A number may have a decimal comma where commas part nothing and no number has a point.
/// Appends what is wrong; the layout is meaningful only if nothing was added.
/// in: text, UTF-8, lines ended by '\n'
TableLayout FindLayout(const std::string& text, const TableFormat& format,
                       const std::vector<std::string>& wanted, std::vector<TableProblem>& problems);

/// "q" of "q (kPa)" and "q[kPa]"; the name itself where it has no unit in brackets.
std::string NameWithoutUnit(const std::string& column);
/// "kPa" of "q (kPa)"; empty where there is none.
std::string UnitInName(const std::string& column);

/// Index of the column with this name, else of the only one with this name before its unit.
/// -1: none; -2: more than one.
std::ptrdiff_t IndexOfColumn(const std::vector<std::string>& columns, const std::string& name);

}  // namespace calib::campaign
