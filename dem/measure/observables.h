#pragma once
// From a settled assembly to the observables of a load step.

#include <string>
#include <vector>

#include "dem/dynamics/assembly.h"
#include "dem/measure/apparatus.h"

namespace calib::dem {

/// Macroscopic state of one specimen. SI, compression positive; strains logarithmic from the
/// reference lengths.
struct Measurement {
  double axial_strain = 0, volumetric_strain = 0, lateral_strain = 0;
  double axial_stress = 0, lateral_stress = 0, mean_stress = 0, deviatoric_stress = 0;
  double stress_ratio = 0, q_over_p = 0;
  double shear_strain = 0, shear_stress = 0, shear_stress_ratio = 0;
  double pore_pressure = 0;  ///< left at zero by Measure(): it needs the cell pressure
  double porosity = 0, void_ratio = 0, coordination_number = 0;
};

/// Strains from the cell, Love-Weber stresses of the last force evaluation, porosity from the sum
/// of sphere volumes, coordination number 2 Nc/Np over all grains. axial = z. reference: three
/// lengths [m] > 0 of zero strain; shear strain is the displacement of the top over reference[2].
Measurement Measure(const Assembly& assembly, const double reference[3]);

/// The measurement as the laboratory reads it through an apparatus that loads the specimen with x
/// [Pa]; `by_axial` where volume follows from the axial strain. Readings derived from others
/// follow.
Measurement ReadThrough(const Apparatus& apparatus, double x, bool by_axial, Measurement m);

/// A member of Measurement by the name of its observable, or null.
double Measurement::*MemberNamed(const std::string& name);

/// Renews what follows from the axial and lateral stress, the shear stress and the porosity.
void DeriveReadings(Measurement& measurement);

/// Values of the named observables. Precondition: every name is a member of Measurement.
std::vector<double> Select(const Measurement& measurement, const std::vector<std::string>& names);

/// Void volume over cell volume.
double Porosity(const Assembly& assembly);

}  // namespace calib::dem
