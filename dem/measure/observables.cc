#include "dem/measure/observables.h"

#include <cassert>
#include <cmath>
#include <map>

#include "dem/elementary/functions.h"

namespace calib::dem {

double Porosity(const Assembly& assembly) {
  return 1.0 - assembly.solid_volume() / assembly.cell().Volume();
}

void DeriveReadings(Measurement& m) {
  m.mean_stress = (m.axial_stress + 2.0 * m.lateral_stress) / 3.0;
  m.deviatoric_stress = m.axial_stress - m.lateral_stress;
  m.stress_ratio = m.axial_stress / m.lateral_stress;
  m.q_over_p = m.deviatoric_stress / m.mean_stress;
  m.shear_stress_ratio = m.shear_stress / m.axial_stress;
  m.void_ratio = m.porosity / (1.0 - m.porosity);
}

Measurement ReadThrough(const Apparatus& apparatus, double x, bool by_axial, Measurement m) {
  if (!apparatus.Alters()) {
    return m;
  }
  m.lateral_stress -= apparatus.MembraneStress(m.lateral_strain);
  m.axial_stress += apparatus.load_gain * x + apparatus.load_offset;
  if (apparatus.AltersStrain()) {
    const double rig = apparatus.RigStrain(x);
    m.axial_strain += rig;
    if (by_axial) {
      m.volumetric_strain += rig;
      m.porosity = 1.0 - (1.0 - m.porosity) * Exp(rig);
    }
    m.lateral_strain = 0.5 * (m.volumetric_strain - m.axial_strain);
  }
  DeriveReadings(m);
  return m;
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

double Measurement::*MemberNamed(const std::string& name) {
  static const std::map<std::string, double Measurement::*> members = {
      {"axial_strain", &Measurement::axial_strain},
      {"volumetric_strain", &Measurement::volumetric_strain},
      {"lateral_strain", &Measurement::lateral_strain},
      {"axial_stress", &Measurement::axial_stress},
      {"lateral_stress", &Measurement::lateral_stress},
      {"mean_stress", &Measurement::mean_stress},
      {"deviatoric_stress", &Measurement::deviatoric_stress},
      {"stress_ratio", &Measurement::stress_ratio},
      {"q_over_p", &Measurement::q_over_p},
      {"shear_strain", &Measurement::shear_strain},
      {"shear_stress", &Measurement::shear_stress},
      {"shear_stress_ratio", &Measurement::shear_stress_ratio},
      {"pore_pressure", &Measurement::pore_pressure},
      {"porosity", &Measurement::porosity},
      {"void_ratio", &Measurement::void_ratio},
      {"coordination_number", &Measurement::coordination_number},
  };
  const auto it = members.find(name);
  return it == members.end() ? nullptr : it->second;
}

std::vector<double> Select(const Measurement& m, const std::vector<std::string>& names) {
  std::vector<double> values;
  values.reserve(names.size());
  for (const std::string& name : names) {
    double Measurement::*const member = MemberNamed(name);
    assert(member != nullptr);
    values.push_back(m.*member);
  }
  return values;
}

}  // namespace calib::dem
