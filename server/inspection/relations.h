#pragma once
// What physics ties the columns of a file to each other, and what follows from it for their signs
// and names.

#include "server/inspection/inspection.h"

namespace calib::inspection {

/// Identities of the largest test, in SI: of stresses q = sa - sr, p = (sa + 2 sr)/3, effective =
/// total - pore pressure, dq/dp = 3 (mean stress), 2 (half sum) where the lateral stress is held;
/// of strains ev = ea + 2 er, de = -(1 + e0) dev [Wood 1990, ch. 1]; load over area, displacement
/// over length; strain and strength have one sign. What holds is evidence, what does not a finding.
void CheckRelations(Inspection& inspection);

}  // namespace calib::inspection
