#pragma once
// Tables for the terminal: columns as wide as their longest cell, numbers to the right.

#include <string>
#include <vector>

namespace calib::report {

class TextTable {
 public:
  /// A leading '<' aligns a column to the left: {"<parameter", "mean", "± sd"}.
  explicit TextTable(const std::vector<std::string>& columns);

  /// Missing cells are empty. Cells longer than 48 characters are cut with an ellipsis.
  void AddRow(std::vector<std::string> cells);

  /// Two blanks between columns, the header first; no trailing blanks. Empty without rows.
  std::string ToString() const;

 private:
  std::vector<std::vector<std::string>> rows_;  // header first
  std::vector<bool> left_;
};

/// Words in lines of at most 98 columns; `first` begins the first of them, `indent`
/// the others.
std::string Wrapped(const std::string& text, const std::string& first, const std::string& indent);

}  // namespace calib::report
