#pragma once
// What an engineer reads off a stress-strain curve: bulk properties of one run.

#include <string>
#include <vector>

#include "server/report/views/campaign_view.h"

namespace calib::report {

struct BulkProperty {
  std::string name;
  std::string unit;  ///< SI
  double value = 0;  ///< NaN: the curve does not tell
};

/// The bulk properties of a drained triaxial run, from states that hold axial_strain (or are
/// controlled by it), volumetric_strain, and deviatoric_stress, stress_ratio or q_over_p:
///   secant_modulus       q / e_a at deviatoric strain e_d = e_a - e_v / 3 = 1 %, interpolated [Pa]
///   secant_poisson_ratio -e_r / e_a there, e_r = (e_v - e_a) / 2     [Cheng 2018, sec. 5.3]
///   peak_friction_angle  asin((R - 1) / (R + 1)) at the largest stress ratio R [rad]
///   critical_friction_angle  the same of the mean R over the last tenth of the axial strain: that
///                        of the critical state only where the run goes as far
/// Strains from the start of loading, logarithmic, compression positive. Always these four, in this
/// order; none for another test. Unloading ends the curve.
std::vector<BulkProperty> BulkProperties(const campaign::Experiment& experiment,
                                         const StateHistory& history);

/// Why a run to its end does not have the property `name` of an experiment, as a clause: "no
/// volumetric_strain is among its observables".
std::string WhyNoBulkProperty(const campaign::Experiment& experiment, const StateHistory& history,
                              const std::string& name);

}  // namespace calib::report
