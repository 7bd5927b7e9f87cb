#pragma once
// A file on this machine, read and inspected.

#include <string>
#include <vector>

#include "server/inspection/inspection_json.h"

namespace calib::inspection {

/// Files beyond this are not read: a table of readings is far below [bytes].
inline constexpr std::size_t kLargestFile = std::size_t{256} << 20;

/// Reads and inspects. sheet: of a workbook; empty: the one that holds numbers. What is wrong, also
/// that there is no such file, stands in the answer's problems. Only the bytes that are looked at
/// are read.
InspectedFile InspectFile(const std::string& file, const std::string& sheet,
                          const std::vector<SaidMeaning>& said);

}  // namespace calib::inspection
