#pragma once
// What a measured observable can be at all: mistakes of units and signs are found before anything
// runs.

#include <string>
#include <vector>

#include "server/campaign/laboratory_table.h"

namespace calib::campaign {

/// Adds one problem, naming file, row and column, for the first reading outside what its observable
/// can be whatever the material: a porosity is a fraction, grains carry no tension, an angle of
/// repose is at most a right one. Observables whose range is not certain are not looked at; strains
/// are by LaboratoryTable::ToModel.
/// in: values, SI, one per row of the table; NaN where a field could not be read
void CheckRangeOf(const std::string& observable, const LaboratoryTable& table,
                  const std::vector<double>& values, ReadContext& context);

}  // namespace calib::campaign
