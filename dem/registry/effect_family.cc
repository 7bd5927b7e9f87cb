#include "dem/registry/effect_family.h"

#include <vector>

namespace calib::dem {
namespace {

struct Family {
  const char* name;
  std::vector<std::string> members;
};

const std::vector<Family>& Families() {
  static const std::vector<Family> families = {
      // Grains pull at each other, which adds to the confining pressure where it is low.
      {"adhesion", {"adhesion_dmt", "adhesion_jkr", "capillary_bridges", "linear_cohesion"}},
      // Grains turn less easily, so that columns of force carry more and dilate more.
      {"rotation", {"nonspherical_shape", "rolling_resistance", "twisting_resistance"}},
      // Strain is read that the specimen does not have: its ends seat, the frame gives way.
      {"strain_reading", {"apparatus_compliance", "strain_offset"}},
  };
  return families;
}

}  // namespace

std::string FamilyOf(const EffectInfo& effect) {
  for (const Family& family : Families()) {
    for (const std::string& member : family.members) {
      if (member == effect.name) return family.name;
    }
  }
  return "";
}

}  // namespace calib::dem
