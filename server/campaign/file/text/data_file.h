#pragma once
// Tables of numbers as laboratories, spreadsheets and other codes write them. What their form may
// be, and how it is found, stands in table_layout.h; in which bytes, in encoding.h.

#include <string>
#include <vector>

#include "server/campaign/file/text/table_layout.h"

namespace calib::campaign {

/// A parsed table.
class DataTable {
 public:
  /// Finds header and rows. `wanted` decides between several lines that might be the header.
  /// Appends what is wrong (no text, no rows, no header, lengths that do not fit); the table is
  /// usable only if nothing was added.
  DataTable(const std::string& bytes, const TableFormat& format,
            const std::vector<std::string>& wanted, std::vector<TableProblem>& problems);
  DataTable(const std::string& bytes, const std::vector<std::string>& wanted,
            std::vector<TableProblem>& problems)
      : DataTable(bytes, TableFormat{}, wanted, problems) {}

  const std::vector<std::string>& columns() const { return layout_.columns; }
  std::size_t rows() const { return layout_.rows.size(); }
  int LineOf(std::size_t row) const { return layout_.rows[row].line; }
  /// A column is asked for by its name, or by that without its unit in brackets.
  bool Has(const std::string& column) const;
  /// What stands in brackets behind the column's name; empty: nothing, or no such column.
  std::string UnitOf(const std::string& column) const;

  /// The numbers of a column, one per row. Appends one problem per bad field (not a number, NaN or
  /// infinite, missing), at most five per column; no such column: one problem with the nearest
  /// name. Meaningful only if nothing was added.
  std::vector<double> Column(const std::string& name, std::vector<TableProblem>& problems) const;

  /// The same where readings may be missing: NaN for those.
  std::vector<double> ColumnWithGaps(const std::string& name,
                                     std::vector<TableProblem>& problems) const;

  /// The fields of a column as written ("" where missing); empty when there is no such column.
  std::vector<std::string> Texts(const std::string& name) const;

 private:
  std::vector<double> Read(const std::string& name, bool gaps,
                           std::vector<TableProblem>& problems) const;

  TableLayout layout_;
  std::vector<std::string> missing_;
};

}  // namespace calib::campaign
