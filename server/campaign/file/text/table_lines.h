#pragma once
// The lines of a text that may belong to a table, without remarks.

#include <string_view>
#include <vector>

namespace calib::campaign {

struct TableLine {
  int number = 0;            ///< from 1
  std::string_view content;  ///< without remark and comment sign; into the text
  bool comment = false;
};

/// "a b" of "# a b" and "** a b": what stands behind the signs that make a line a comment
/// somewhere.
std::string_view WithoutCommentSigns(std::string_view line);

/// Lines with content behind the first `skip`. `#` begins a remark, but in quotes and in the errors
/// of spreadsheets (#N/A). A blank at the end is kept: a tab may part an empty cell.
std::vector<TableLine> LinesOf(std::string_view text, int skip);

}  // namespace calib::campaign
