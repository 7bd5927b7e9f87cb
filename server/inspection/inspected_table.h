#pragma once
// A laboratory's file as the campaign's own reader of tables sees it, before anything is known of
// its columns: one table, or several tests by a column that names them or in stacked sections.

#include <string>
#include <vector>

#include "server/campaign/file/text/table_layout.h"

namespace calib::inspection {

struct InspectedColumn {
  std::string name;              ///< as campaign files call it
  std::string header;            ///< with its unit, as it stands
  std::string unit;              ///< as written in its heading or in the line below; empty: none
  std::vector<double> values{};  ///< one per row, as they stand; NaN: missing, or no number
  int missing = 0;               ///< cells in which nothing was measured
  int texts = 0;                 ///< cells that say something else than a number
  int dates = 0;                 ///< of those, days as 2024-05-01, 1.5.2024 or 5/1/2024
};

/// The rows of one test.
struct InspectedPart {
  std::string name;                ///< as the file calls it; empty where the file is one test
  campaign::TableFormat format{};  ///< by which a campaign reads these rows alone
  std::vector<int> lines{};        ///< of each row, from 1
  std::vector<InspectedColumn> columns{};
};

struct InspectedTable {
  std::string encoding{};
  campaign::Parting parting = campaign::Parting::kBlanks;
  campaign::DecimalMark mark = campaign::DecimalMark::kPoint;
  int header_lines = 0;         ///< lines above the first row
  std::string naming_column{};  ///< whose texts name the tests; empty: none
  /// Words of that column name stages of one test (iso, shear), not tests.
  bool names_stages = false;
  std::vector<std::string> remarks{};  ///< lines above the table that are neither header nor units
  std::vector<InspectedPart> parts{};  ///< one at least; all with the same columns where named
};

/// Reads a file's bytes. Appends what is wrong, each with its line; the table is meaningful only if
/// nothing was added. A header that the campaign's reader would not take for one is none: such
/// columns are called 1, 2, ... Pure.
InspectedTable ReadInspectedTable(const std::string& bytes,
                                  std::vector<campaign::TableProblem>& problems);

}  // namespace calib::inspection
