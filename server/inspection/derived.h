#pragma once
// Quantities that a file does not hold but that follow from those it has.

#include "server/inspection/inspection.h"

namespace calib::inspection {

/// Adds to inspection.derived, each with a note that says how:
///   axial strain = volumetric - 2 lateral strain; or displacement over the stated height;
///   deviatoric stress = load / A0 (1 - ea)/(1 - ev), A0 by the stated diameter, where the load
///   begins at zero: a cylinder stays one [ASTM D7181, 8.2].
/// A quantity that has a column is not derived.
void DeriveQuantities(Inspection& inspection);

}  // namespace calib::inspection
