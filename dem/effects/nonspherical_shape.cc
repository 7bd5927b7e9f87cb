// `nonspherical_shape`: elongated grains in place of spheres.

#include "dem/model/effect.h"

namespace calib::dem {
namespace {

void Prepare(const ParameterSet& parameters, Preparation& preparation) {
  preparation.aspect = parameters.Get("aspect");
}

}  // namespace

/// Every sphere becomes a rigid clump of two equal overlapping spheres of the same volume (of the
/// union), length over width `aspect`, directions at random; the specimen is brought to the new
/// shape at constant porosity before consolidation (simulation/shape_change.h). Poured grains are
/// set loosely with their shape and fall into place, or are fed in along the belt; in a plane they
/// turn about its normal only, and where a thickness makes disks they are two equal overlapping
/// disks of the same area. Null by definition at aspect 1: spheres.
/// One-sided. [Favier et al. 1999; Ng 2004, J. Eng. Mech. 130, 193]
EffectEntry NonsphericalShape() {
  ParameterInfo aspect;
  aspect.name = "aspect";
  aspect.unit = std::string("1");
  aspect.min = 1;
  aspect.max = 2;
  aspect.default_prior = {.kind = "uniform", .min = 1, .max = 2};
  aspect.null_value = 1;
  aspect.description = "length over width of the grains; 2: two spheres that just touch";
  return {.info = {.name = "nonspherical_shape",
                   .kind = "particle",
                   .description =
                       "Rigid clumps of two equal spheres of the volume of the sphere that they "
                       "replace (disks: of two of its area), at random directions and the "
                       "packing's porosity; one-sided, "
                       "vanishes at aspect 1",
                   .contacts = {},
                   .parameters = {aspect},
                   .reference = "Favier et al., Eng. Comput. 16 (1999) 467; Ng, J. Eng. Mech. 130 "
                                "(2004) 193",
                   .family = "rotation",
                   .two_sided = false,
                   .rays = {{.parameter = "aspect", .steps = {0.1, 0.3}}},
                   .makes_clumps = true,
                   .one_material = ""},
          .place = 10,
          .shows_in = [](const TestInfo& test) { return test.needs_packing; },
          .prepare = &Prepare};
}

}  // namespace calib::dem
