#pragma once
// Which column is which: by its heading, by what its numbers can be, and by what physics ties it
// to.

#include <vector>

#include "server/inspection/inspection.h"

namespace calib::inspection {

/// Decides roles, units and signs of all columns from the largest test of the file, and says what
/// speaks for each and what contradicts. A heading by a word decides; one by a letter needs the
/// numbers' consent and company in the file. Where two readings are left the column stays open.
/// in: inspection.table, stated_pressure; out: columns, logarithmic, findings
void DecideMeanings(const std::vector<SaidMeaning>& said, Inspection& inspection);

/// Index of the test with the most rows.
std::size_t LargestTest(const InspectedTable& table);

}  // namespace calib::inspection
