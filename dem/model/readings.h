#pragma once
// Readings of a specimen in its periodic cell, and what instruments do to them.

#include <span>
#include <string>

#include "dem/model/observable.h"
#include "dem/model/rig.h"

namespace calib::dem {

/// Macroscopic state of one specimen. SI, compression positive; strains logarithmic from the
/// reference lengths.
struct Measurement {
  double axial_strain = 0, volumetric_strain = 0, lateral_strain = 0;
  double axial_stress = 0, lateral_stress = 0, mean_stress = 0, deviatoric_stress = 0;
  double stress_ratio = 0, q_over_p = 0;
  double shear_strain = 0, shear_stress = 0, shear_stress_ratio = 0;
  double pore_pressure = 0;  ///< needs the cell pressure, which the specimen does not know
  double porosity = 0, void_ratio = 0, coordination_number = 0;
};

/// One observable that every specimen in a periodic cell has, and the member that holds its value.
struct ReadingEntry {
  ObservableInfo info;
  double Measurement::*member = nullptr;
  int place = 1000;  ///< ObservableEntry::place
};

/// All members of Measurement, in their order.
std::span<const ReadingEntry> Readings();

/// The measurement `m` as the laboratory reads it through an apparatus that loads the specimen with
/// x [Pa] (model/rig.h). by_axial: the laboratory takes the volume from the axial strain. Readings
/// that are derived from others are renewed. Pure; never fails.
Measurement ReadThrough(const Apparatus& apparatus, double x, bool by_axial, Measurement m);

/// The member of Measurement that holds the observable of this name, or null where there is none.
double Measurement::*MemberNamed(const std::string& name);

/// Renews the members that follow from the axial, lateral and shear stress and from the porosity:
/// mean and deviatoric stress, the ratios, the void ratio.
void DeriveReadings(Measurement& measurement);

}  // namespace calib::dem
