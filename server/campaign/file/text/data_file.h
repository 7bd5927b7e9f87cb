#pragma once
// Tables of numbers as laboratories and other codes write them: whitespace- or comma-separated, `#`
// comments, one header line (which may itself begin with `#`), blank trailing fields tolerated.

#include <string>
#include <string_view>
#include <vector>

namespace calib::campaign {

/// One thing wrong in a table. line is 1-based; 0: the file as a whole. column may be empty.
struct TableProblem {
  int line = 0;
  std::string column;
  std::string message;
};

/// A parsed table; owns its text.
class DataTable {
 public:
  /// Splits text into header and rows. `wanted` decides between several comment lines that might be
  /// the header. Appends what is wrong (no rows, no header, more fields than columns); the table is
  /// usable only if nothing was added.
  DataTable(std::string text, const std::vector<std::string>& wanted,
            std::vector<TableProblem>& problems);

  const std::vector<std::string>& columns() const { return columns_; }
  std::size_t rows() const { return rows_.size(); }
  int LineOf(std::size_t row) const { return rows_[row].line; }
  bool Has(const std::string& column) const;

  /// The numbers of a column, one per row. Appends one problem per bad field (not a number, NaN or
  /// infinite, missing), at most five per column; no such column: one problem with the nearest
  /// name. Meaningful only if nothing was added.
  std::vector<double> Column(const std::string& name, std::vector<TableProblem>& problems) const;

  /// The fields of a column as written ("" where missing); empty when there is no such column.
  std::vector<std::string> Texts(const std::string& name) const;

 private:
  struct Row {
    int line = 0;
    std::vector<std::string_view> fields;  // into text_
  };

  std::ptrdiff_t IndexOf(const std::string& column) const;

  std::string text_;
  std::vector<std::string> columns_;
  int header_line_ = 0;
  std::vector<Row> rows_;

 public:
  DataTable(const DataTable&) = delete;  // rows point into the text
  DataTable& operator=(const DataTable&) = delete;
};

}  // namespace calib::campaign
