// `initial_density`: a specimen of another density than assumed.

#include "dem/model/effect.h"

namespace calib::dem {
namespace {

void Prepare(const ParameterSet& parameters, Preparation& preparation) {
  preparation.densification += parameters.Get("densification");
}

}  // namespace

/// Porosity at the start of loading is lower by `densification` than consolidation as asked for
/// would make it: a porosity that is asked for is shifted, otherwise friction is lowered at the
/// consolidation pressure (and restored) until the shifted porosity holds, within 1e-4. Looser
/// (below zero) is possible where consolidation asks for a porosity or for less friction than the
/// model's own; where it is not, the run has diverged, with the attainable range as the reason.
/// Two-sided, vanishes at 0. [Cheng 2018, sec. 2.2, on the procedure]
EffectEntry InitialDensity() {
  ParameterInfo densification;
  densification.name = "densification";
  densification.unit = std::string("1");
  densification.min = -0.2;
  densification.max = 0.2;
  densification.default_prior = {.kind = "uniform", .min = -0.02, .max = 0.04};
  densification.null_value = 0;
  densification.scale = {.factor = 0.01};
  densification.description = "fall of porosity against consolidation as asked for";
  return {.info = {.name = "initial_density",
                   .kind = "initial_state",
                   .description = "Porosity at the start is lower by densification, by less "
                                  "friction during consolidation; "
                                  "two-sided (looser only where consolidation uses a porosity or "
                                  "lowered friction), vanishes "
                                  "at densification 0",
                   .contacts = {},
                   .parameters = {densification},
                   .reference = "Cheng et al. 2018, sec. 2.2",
                   .two_sided = true,
                   .rays = {{.parameter = "densification", .steps = {0.5, 1.5}}}},
          .place = 130,
          .shows_in = &InPeriodicCell,
          .prepare = &Prepare};
}

}  // namespace calib::dem
