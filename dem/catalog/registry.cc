#include "dem/catalog/registry.h"

#include <vector>

#include "dem/contact/hertz_mindlin.h"
#include "dem/contact/linear.h"
#include "dem/effects/adhesion_dmt.h"
#include "dem/effects/adhesion_jkr.h"
#include "dem/effects/capillary_bridges.h"
#include "dem/effects/contact_plasticity.h"
#include "dem/effects/hertz_nonlinearity.h"
#include "dem/effects/linear_cohesion.h"
#include "dem/effects/pressure_dependent_friction.h"
#include "dem/effects/rolling_resistance.h"
#include "dem/effects/twisting_resistance.h"
#include "dem/effects/viscous_damping.h"
#include "dem/lab_tests/isotropic.h"
#include "dem/lab_tests/oedometric.h"
#include "dem/lab_tests/triaxial_drained.h"

namespace calib::dem {

std::span<const ContactEntry> ContactEntries() {
  static const std::vector<ContactEntry> entries = {HertzMindlin(), Linear()};
  return entries;
}

std::span<const EffectEntry> EffectEntries() {
  static const std::vector<EffectEntry> entries = {
      HertzNonlinearity(), ContactPlasticity(), LinearCohesion(), AdhesionDmt(),
      AdhesionJkr(),       CapillaryBridges(),  ViscousDamping(), PressureDependentFriction(),
      RollingResistance(), TwistingResistance()};
  return entries;
}

std::span<const ElementTestEntry> ElementTestEntries() {
  static const std::vector<ElementTestEntry> entries = {Isotropic(), Oedometric(),
                                                        TriaxialDrained()};
  return entries;
}

}  // namespace calib::dem
