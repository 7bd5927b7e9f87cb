#pragma once
// In which units the columns of a file stand.

#include "server/inspection/inspection.h"

namespace calib::inspection {

/// Factor of each column whose role is known: by its unit; without one by what it can be at all
/// (a strain is below one), by what ties it to another column, by the columns of its kind. Where
/// two units are left the column stays open.
void DecideUnits(Inspection& inspection);

}  // namespace calib::inspection
