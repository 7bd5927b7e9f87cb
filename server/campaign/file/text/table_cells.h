#pragma once
// One line of a table: how it is parted into cells, and what a cell says.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace calib::campaign {

/// What parts the cells of a line.
enum class Parting {
  kSemicolons,
  kCommas,
  kTabs,      ///< each tab ends a cell, so that a cell may be empty
  kBlanks,    ///< blanks and tabs in any number, so that no cell is empty
  kGaps,      ///< a tab or two blanks and more: a cell may hold single blanks, as names do
  kUnits,     ///< blanks, but a word in brackets belongs to the one before it: "q (kPa)"
  kUnitEnds,  ///< a word in brackets ends a cell: "axial strain (%) q (kPa)"
};

/// Trimmed of blanks, tabs and what else ends a line.
std::string_view Trimmed(std::string_view text);

/// The cells of a line, trimmed. A cell in double quotes is taken as it is, also with what parts
/// the others; where cells may be empty a doubled quote within it stands for one.
std::vector<std::string> CellsOf(std::string_view line, Parting parting);

/// Which sign parts a number from its fraction.
enum class DecimalMark { kPoint, kComma };

/// The number that a cell says, also as Fortran (1.5D-3) and typesetters (a long minus) write it;
/// infinities and NaN as well.
std::optional<double> NumberIn(std::string_view cell, DecimalMark mark);

/// "0,25", "-1,5e3": a number whose only comma stands between digits.
bool HasDecimalComma(std::string_view cell);

/// "1,234", "12,345,678": it may be a number of thousands as well.
bool MayHoldThousands(std::string_view cell);

/// Empty, or one of the words by which programs say that nothing was measured (NaN, NA, N/A, #N/A,
/// in any case) or of `more`, which are taken as they stand, numbers by their value.
bool SaysMissing(std::string_view cell, const std::vector<std::string>& more);

}  // namespace calib::campaign
