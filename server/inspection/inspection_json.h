#pragma once
// An inspection as the document of `calibctl inspect --json`.

#include <string>
#include <vector>

#include "server/inspection/inspection.h"

namespace calib::inspection {

/// What came of one file: an inspection, or why there is none.
struct InspectedFile {
  std::string file;
  Inspection inspection{};
  std::vector<campaign::TableProblem> problems{};  ///< empty: inspected
};

/// One object; an array where several files were asked for.
std::string InspectionJson(const std::vector<InspectedFile>& files);

/// "semicolon", "comma", "tab", "blanks", as the campaign key `separator` takes it.
const char* DelimiterWord(campaign::Parting parting);
/// "point" or "comma", as the campaign key `decimal` takes it.
const char* DecimalWord(campaign::DecimalMark mark);

}  // namespace calib::inspection
