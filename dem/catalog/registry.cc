#include "dem/catalog/registry.h"

#include <algorithm>
#include <tuple>
#include <utility>
#include <vector>

#include "dem/catalog/found_effects.h"
#include "dem/contact/extended_viscoelastic.h"
#include "dem/contact/hertz_mindlin.h"
#include "dem/contact/kuwabara_kono.h"
#include "dem/contact/linear.h"
#include "dem/contact/tsuji.h"
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
  static const std::vector<EffectEntry> entries = [] {
    std::vector<EffectEntry> found = FoundEffects();
    std::sort(found.begin(), found.end(), [](const EffectEntry& a, const EffectEntry& b) {
      return std::tie(a.place, a.info.name) < std::tie(b.place, b.info.name);
    });
    return found;
  }();
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
