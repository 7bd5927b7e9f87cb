#pragma once
// What a measured observable can be at all: mistakes of units and signs are found before anything
// runs.

#include "server/campaign/file/laboratory_table.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// Adds one problem, naming file, row and column, for the first reading outside what its observable
/// can be whatever the material: a porosity is a fraction, most stresses are compressive, an angle
/// of repose is at most a right one. A reading may be outside by four times its error or by 2 % of
/// the largest of the column, as zeros drift. Observables whose range is not certain are not looked
/// at; strains are by LaboratoryTable::ToModel.
/// in: observable.values, SI, one per row of the table, NaN where a field could not be read;
///     observable.sd, as many or none
void CheckRangeOf(const MeasuredObservable& observable, const LaboratoryTable& table,
                  ReadContext& context);

}  // namespace calib::campaign
