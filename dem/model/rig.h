#pragma once
// What stands between the specimen and the readings of a laboratory: the effects of kind
// "measurement" set it, the element test drives and reports through it.

#include <algorithm>
#include <cmath>

#include "dem/elementary/functions.h"

namespace calib::dem {

/// Errors of an apparatus; as constructed it has none. Compression positive; x is the load on the
/// rig since the start of loading, the change of q in triaxial tests, of the axial stress in
/// oedometric ones [Pa].
struct Apparatus {
  double compliance = 0;      ///< of the loading frame, 1/K [1/Pa]
  double seating = 0;         ///< d0, strain of bedding errors once they have closed [-]
  double seating_stress = 1;  ///< q0, load that closes 63 % of them [Pa] > 0
  double membrane = 0;        ///< M, lateral stress of the membrane per lateral extension [Pa]
  double load_gain = 0;       ///< relative error of the load cell [-]
  double load_offset = 0;     ///< zero error of the load cell [Pa]

  /// Whether the axial strain is read with an error, so that the control must follow the reading.
  [[nodiscard]] bool AltersStrain() const { return compliance != 0 || seating != 0; }
  /// Whether any reading differs from the state of the specimen.
  [[nodiscard]] bool Alters() const {
    return AltersStrain() || membrane != 0 || load_gain != 0 || load_offset != 0;
  }

  /// Strain that is read beside that of the specimen [-], x/K + d0 (1 - exp(-x/q0)), where bedding
  /// closes in compression only.
  [[nodiscard]] double RigStrain(double x) const {
    return x * compliance + seating * (1.0 - Exp(-std::max(x, 0.0) / seating_stress));
  }

  /// Derivative of RigStrain() with respect to x [1/Pa].
  [[nodiscard]] double RigSlope(double x) const {
    return compliance + (x >= 0 ? seating / seating_stress * Exp(-x / seating_stress) : 0.0);
  }

  /// Lateral stress that the membrane adds to the cell pressure at a lateral strain [-] [Pa].
  [[nodiscard]] double MembraneStress(double lateral_strain) const {
    return membrane * std::max(0.0, -lateral_strain);
  }
};

}  // namespace calib::dem
