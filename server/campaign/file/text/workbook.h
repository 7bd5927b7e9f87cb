#pragma once
// Sheets of workbooks (.xlsx, .xlsm) as text, by openpyxl (Debian's python3-openpyxl) in a process
// of its own with limits of time, memory and size.

#include <string>

#include "absl/status/statusor.h"

namespace calib::campaign {

/// Whether a path ends as workbooks that can be read do.
bool IsWorkbookPath(const std::string& path);

/// One sheet as comma-separated text in UTF-8, a line for each of its rows: numbers with all their
/// digits, those that the sheet shows in percent times a hundred, formulas by the value stored with
/// them, days and times as 2024-05-01 12:30:00, durations in seconds. sheet: its name; empty: the
/// only one that holds rows of numbers. Thread-safe.
/// Errors, each the rest of a sentence about the file: NOT_FOUND (no such sheet, with the names of
/// those that there are), INVALID_ARGUMENT (no workbook, several sheets with numbers, a formula
/// without a stored value), RESOURCE_EXHAUSTED (beyond the limits), FAILED_PRECONDITION
/// (openpyxl is not installed).
absl::StatusOr<std::string> SheetAsText(const std::string& file, const std::string& sheet);

}  // namespace calib::campaign
