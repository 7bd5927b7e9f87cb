// `particle_crushing`: grains that crush under their contact forces and lose size.

#include "dem/model/effect.h"

namespace calib::dem {
namespace {

void Prepare(const ParameterSet& parameters, Preparation& preparation) {
  preparation.weakness = parameters.Get("weakness");
  preparation.weibull_modulus = parameters.Get("weibull_modulus");
  preparation.reference_diameter = parameters.Get("reference_diameter");
  preparation.size_loss = parameters.Get("size_loss");
}

}  // namespace

/// Law and size-loss rule: dynamics/crushing.h. Vanishes at weakness 0 (infinite strength) and at
/// size_loss 0. One-sided. Fines carry no force and count as solid volume.
/// [McDowell & Bolton 1998]
/// [Marketos & Bolton 2009: crushed material is taken out of the skeleton]
EffectEntry ParticleCrushing() {
  ParameterInfo weakness;
  weakness.name = "weakness";
  weakness.unit = std::string("1/Pa");
  weakness.max = 1;
  weakness.default_prior = {.kind = "log_uniform", .min = 1e-9, .max = 1e-5};
  weakness.null_value = 0;
  weakness.scale = {.pressure = -1};
  weakness.scaled_prior = DefaultPrior{.kind = "log_uniform", .min = 1e-3, .max = 1};
  weakness.description = "1/s0; s0 is the F/d^2 that 37 % of grains of reference_diameter survive";
  ParameterInfo modulus;
  modulus.name = "weibull_modulus";
  modulus.unit = std::string("1");
  modulus.min = 0.5;
  modulus.max = 100;
  modulus.default_prior = {.kind = "uniform", .min = 1, .max = 10};
  modulus.default_value = 3;
  modulus.description = "m, small: strengths scatter widely";
  ParameterInfo diameter;
  diameter.name = "reference_diameter";
  diameter.unit = std::string("m");
  diameter.min_open = true;
  diameter.max = 10;
  diameter.default_prior = {.kind = "log_uniform", .min = 1e-4, .max = 1e-1};
  diameter.default_value = 1e-3;
  diameter.scale = {.diameter = 1};
  diameter.description = "d0, size of the grains whose strength is s0";
  ParameterInfo loss;
  loss.name = "size_loss";
  loss.unit = std::string("1");
  loss.max = 0.9;
  loss.default_prior = {.kind = "uniform", .min = 0.05, .max = 0.5};
  loss.default_value = 0.2;
  loss.null_value = 0;
  loss.description = "share of its diameter that a grain loses each time it crushes";
  return {.info = {.name = "particle_crushing",
                   .kind = "particle",
                   .description =
                       "A grain whose largest contact force F reaches F/d^2 = s loses size_loss of "
                       "its diameter to fines (solid volume without force); s is Weibull "
                       "distributed, P(survival) = exp(-(d/d0)^3 (s weakness)^m); one-sided, "
                       "vanishes at weakness 0 or size_loss 0",
                   .contacts = {},
                   .parameters = {weakness, modulus, diameter, loss},
                   .reference = "McDowell & Bolton, Geotechnique 48 (1998) 667; Marketos & Bolton, "
                                "J. Mech. Phys. Solids 57 (2009) 1813",
                   .two_sided = false,
                   .rays = {{.parameter = "weakness",
                             .steps = {0.1, 0.12},
                             .held = {{"reference_diameter", 1}},
                             // Of few grains that crush: their share goes with weakness^m.
                             .order = *modulus.default_value}},
                   .breaks_grains = true},
          .place = 20,
          .shows_in = &InPeriodicCell,
          .prepare = &Prepare};
}

}  // namespace calib::dem
