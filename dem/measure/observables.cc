#include "dem/measure/observables.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <tuple>

#include "dem/elementary/functions.h"
#include "dem/measure/found_observables.h"

namespace calib::dem {

double Porosity(const Assembly& assembly) {
  return 1.0 - assembly.solid_volume() / assembly.cell().Volume();
}

Measurement Measure(const Assembly& assembly, const double reference[3]) {
  const PeriodicCell& cell = assembly.cell();
  double strain[3];
  for (int a = 0; a < 3; ++a) {
    strain[a] = Log(reference[a] / cell.length[a]);
  }
  const auto& stress = assembly.stress();
  Measurement m;
  m.axial_strain = strain[2];
  m.volumetric_strain = strain[0] + strain[1] + strain[2];
  m.lateral_strain = 0.5 * (strain[0] + strain[1]);
  m.axial_stress = stress[2];
  m.lateral_stress = 0.5 * (stress[0] + stress[1]);
  m.shear_strain = cell.displacement / reference[2];
  m.shear_stress = assembly.shear_stress();
  m.porosity = Porosity(assembly);
  DeriveReadings(m);
  m.coordination_number = 2.0 * static_cast<double>(assembly.contacts()) / assembly.bodies();
  return m;
}

std::span<const ObservableEntry> FurtherObservables() {
  static const std::vector<ObservableEntry> entries = [] {
    std::vector<ObservableEntry> found = FoundObservables();
    std::sort(found.begin(), found.end(), [](const ObservableEntry& a, const ObservableEntry& b) {
      return std::tie(a.place, a.info.name) < std::tie(b.place, b.info.name);
    });
    return found;
  }();
  return entries;
}

std::vector<double> Select(const Measurement& m, const Assembly& settled,
                           const std::vector<std::string>& names) {
  std::vector<double> values;
  values.reserve(names.size());
  for (const std::string& name : names) {
    if (double Measurement::*const member = MemberNamed(name); member != nullptr) {
      values.push_back(m.*member);
      continue;
    }
    const auto further = FurtherObservables();
    const auto it = std::find_if(further.begin(), further.end(), [&](const ObservableEntry& entry) {
      return entry.info.name == name;
    });
    assert(it != further.end());
    values.push_back(it->read(settled));
  }
  return values;
}

}  // namespace calib::dem
