#include "dem/model/readings.h"

#include <algorithm>
#include <vector>

#include "dem/elementary/functions.h"

namespace calib::dem {

std::span<const ReadingEntry> Readings() {
  static const std::vector<ReadingEntry> entries = {
      {.info = {.name = "axial_strain",
                .unit = "1",
                .description = "logarithmic, from the end of consolidation"},
       .member = &Measurement::axial_strain,
       .place = 10},
      {.info = {.name = "volumetric_strain",
                .unit = "1",
                .description = "sum of the three logarithmic strains"},
       .member = &Measurement::volumetric_strain,
       .place = 20},
      {.info = {.name = "lateral_strain",
                .unit = "1",
                .description = "mean of the two lateral logarithmic strains"},
       .member = &Measurement::lateral_strain,
       .place = 30},
      {.info = {.name = "axial_stress", .unit = "Pa", .description = "Love-Weber stress along z"},
       .member = &Measurement::axial_stress,
       .place = 40},
      {.info = {.name = "lateral_stress",
                .unit = "Pa",
                .description = "mean Love-Weber stress along x and y"},
       .member = &Measurement::lateral_stress,
       .place = 50},
      {.info = {.name = "mean_stress", .unit = "Pa", .description = "p = (axial + 2 lateral)/3"},
       .member = &Measurement::mean_stress,
       .place = 60},
      {.info = {.name = "deviatoric_stress", .unit = "Pa", .description = "q = axial - lateral"},
       .member = &Measurement::deviatoric_stress,
       .place = 70},
      {.info = {.name = "stress_ratio", .unit = "1", .description = "axial over lateral stress"},
       .member = &Measurement::stress_ratio,
       .place = 80},
      {.info = {.name = "q_over_p", .unit = "1", .description = "deviatoric over mean stress"},
       .member = &Measurement::q_over_p,
       .place = 90},
      {.info = {.name = "shear_strain",
                .unit = "1",
                .description =
                    "displacement of the top over the height at the end of consolidation"},
       .member = &Measurement::shear_strain,
       .place = 100},
      {.info = {.name = "shear_stress",
                .unit = "Pa",
                .description =
                    "Love-Weber stress on horizontal planes along the shear, mean of xz and zx"},
       .member = &Measurement::shear_stress,
       .place = 110},
      {.info = {.name = "shear_stress_ratio",
                .unit = "1",
                .description = "shear stress over axial (normal) stress"},
       .member = &Measurement::shear_stress_ratio,
       .place = 120},
      {.info = {.name = "pore_pressure",
                .unit = "Pa",
                .description =
                    "excess pore pressure at constant cell pressure: lateral stress at the end "
                    "of consolidation - effective lateral stress"},
       .member = &Measurement::pore_pressure,
       .place = 130},
      {.info = {.name = "porosity", .unit = "1", .description = "void volume over cell volume"},
       .member = &Measurement::porosity,
       .place = 140},
      {.info = {.name = "void_ratio", .unit = "1", .description = "void volume over solid volume"},
       .member = &Measurement::void_ratio,
       .place = 150},
      {.info = {.name = "coordination_number",
                .unit = "1",
                .description = "2 contacts / grains, all grains counted"},
       .member = &Measurement::coordination_number,
       .place = 260},
  };
  return entries;
}

double Measurement::*MemberNamed(const std::string& name) {
  const auto entries = Readings();
  const auto it = std::find_if(entries.begin(), entries.end(),
                               [&](const ReadingEntry& entry) { return entry.info.name == name; });
  return it == entries.end() ? nullptr : it->member;
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

}  // namespace calib::dem
