#include "dem/catalog/registry.h"

#include <utility>
#include <vector>

#include "dem/contact/extended_viscoelastic.h"
#include "dem/contact/hertz_mindlin.h"
#include "dem/contact/kuwabara_kono.h"
#include "dem/contact/linear.h"
#include "dem/contact/tsuji.h"
#include "dem/effects/adhesion_dmt.h"
#include "dem/effects/adhesion_jkr.h"
#include "dem/effects/apparatus_compliance.h"
#include "dem/effects/capillary_bridges.h"
#include "dem/effects/contact_plasticity.h"
#include "dem/effects/hertz_nonlinearity.h"
#include "dem/effects/initial_density.h"
#include "dem/effects/initial_fabric.h"
#include "dem/effects/linear_cohesion.h"
#include "dem/effects/load_cell_error.h"
#include "dem/effects/membrane_stiffness.h"
#include "dem/effects/nonspherical_shape.h"
#include "dem/effects/particle_crushing.h"
#include "dem/effects/pressure_dependent_friction.h"
#include "dem/effects/rolling_resistance.h"
#include "dem/effects/strain_offset.h"
#include "dem/effects/twisting_resistance.h"
#include "dem/effects/viscous_damping.h"
#include "dem/effects/wall_friction.h"
#include "dem/lab_tests/angle_of_repose.h"
#include "dem/lab_tests/calibration_device.h"
#include "dem/lab_tests/isotropic.h"
#include "dem/lab_tests/oedometric.h"
#include "dem/lab_tests/rotating_drum.h"
#include "dem/lab_tests/shaken_box.h"
#include "dem/lab_tests/silo_discharge.h"
#include "dem/lab_tests/simple_shear.h"
#include "dem/lab_tests/transfer_chute.h"
#include "dem/lab_tests/triaxial_drained.h"
#include "dem/lab_tests/triaxial_undrained.h"

namespace calib::dem {

ParameterSet ResolveParameters(const std::vector<ParameterInfo>& infos, const std::string& prefix,
                               const std::map<std::string, double>& given) {
  std::map<std::string, double> values;
  for (const ParameterInfo& info : infos) {
    if (const auto it = given.find(prefix + info.name); it != given.end()) {
      values[info.name] = it->second;
    } else if (info.default_value) {
      values[info.name] = *info.default_value;
    }
  }
  return ParameterSet(std::move(values));
}

std::span<const ContactEntry> ContactEntries() {
  static const std::vector<ContactEntry> entries = {HertzMindlin(), Linear(), Tsuji(),
                                                    KuwabaraKono(), ExtendedViscoelastic()};
  return entries;
}

std::span<const EffectEntry> EffectEntries() {
  static const std::vector<EffectEntry> entries = {NonsphericalShape(), ParticleCrushing(),
                                                   HertzNonlinearity(), ContactPlasticity(),
                                                   LinearCohesion(),    AdhesionDmt(),
                                                   AdhesionJkr(),       CapillaryBridges(),
                                                   ViscousDamping(),    PressureDependentFriction(),
                                                   RollingResistance(), TwistingResistance(),
                                                   InitialDensity(),    InitialFabric(),
                                                   WallFriction(),      ApparatusCompliance(),
                                                   StrainOffset(),      MembraneStiffness(),
                                                   LoadCellError()};
  return entries;
}

std::span<const ElementTestEntry> ElementTestEntries() {
  static const std::vector<ElementTestEntry> entries = {
      Isotropic(), Oedometric(), TriaxialDrained(), TriaxialUndrained(), SimpleShear()};
  return entries;
}

std::span<const GravityTestEntry> GravityTestEntries() {
  static const std::vector<GravityTestEntry> entries = {AngleOfRepose(), SiloDischarge(),
                                                        RotatingDrum(),  CalibrationDevice(),
                                                        TransferChute(), ShakenBox()};
  return entries;
}

}  // namespace calib::dem
