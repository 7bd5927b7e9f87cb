#pragma once
// From a settled assembly to the observables of a load step.

#include <span>
#include <string>
#include <vector>

#include "dem/dynamics/assembly.h"
#include "dem/model/readings.h"

namespace calib::dem {

/// Reads the specimen: strains from the cell, Love-Weber stresses of the last force evaluation,
/// porosity from the sum of sphere volumes, coordination number 2 Nc/Np over all grains. axial = z.
/// reference: three lengths [m] > 0 of zero strain; shear strain is the displacement of the top
/// over reference[2].
Measurement Measure(const Assembly& assembly, const double reference[3]);

/// What every test in the periodic cell reads beside its readings: FoundObservables() in the order
/// of their places. They live as long as the program; thread-safe.
std::span<const ObservableEntry> FurtherObservables();

/// Values of the named observables in SI units, in the order of `names`: members of the
/// measurement, and FurtherObservables() read from the settled assembly. Precondition: every name
/// is one of these.
std::vector<double> Select(const Measurement& measurement, const Assembly& settled,
                           const std::vector<std::string>& names);

/// Porosity [-]: 1 - solid_volume() / volume of the cell.
double Porosity(const Assembly& assembly);

}  // namespace calib::dem
