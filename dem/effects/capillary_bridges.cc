// `capillary_bridges`: liquid bridges that form on touching and hold across a gap.

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "dem/contact/materials.h"
#include "dem/contact/simd.h"
#include "dem/elementary/functions.h"
#include "dem/elementary/power.h"
#include "dem/model/effect.h"

namespace calib::dem {
namespace {

struct Liquid {
  double stretch = 1;  ///< 1 + theta/2
  double volume = 0;   ///< of every bridge [m^3]
  double ratio = 0;    ///< of volume to R^3; one of the two is zero
};

/// Gap at which the bridge of two grains with mean radius R ruptures [m].
inline double RuptureGap(const Liquid& liquid, double radius) {
  const double volume = liquid.volume + liquid.ratio * (radius * radius * radius);
  return liquid.stretch * Power(volume, 1.0 / 3.0);
}

/// tension: gamma cos(theta) [N/m] > 0
CALIB_DEM_INLINE void BridgeLane(const Liquid& liquid, double tension, int k, ContactBlock& b) {
  const double radius = 2.0 * b.effective_radius[k];
  const double gap = b.overlap[k] < 0 ? -b.overlap[k] : 0.0;
  const double volume = liquid.volume + liquid.ratio * (radius * radius * radius);
  const double scaled = gap * std::sqrt(radius / volume);
  const double bridge =
      2.0 * std::numbers::pi * tension * radius / (1.0 + 1.05 * scaled + 2.5 * (scaled * scaled));
  const double on = gap < RuptureGap(liquid, radius) ? 1.0 : 0.0;
  const double pull = on * bridge;
  b.normal_force[k] -= pull;
  b.attraction[k] += pull;
  b.holds[k] += tension > 0 ? on : 0.0;
}

CALIB_DEM_CLONES void Bridge(const Liquid liquid, double tension, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    BridgeLane(liquid, tension, k, b);
  }
}

CALIB_DEM_CLONES void BridgePairs(const Liquid liquid, const double* tension, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    BridgeLane(liquid, tension[b.materials[k]], k, b);
  }
}

class BridgeKernel final : public ContactKernel {
 public:
  BridgeKernel(const Liquid& liquid, std::vector<double> tension)
      : liquid_(liquid), tension_(std::move(tension)) {}
  [[nodiscard]] double Reach(double largest_radius) const override {
    return RuptureGap(liquid_, largest_radius);
  }
  void Apply(ContactBlock& block, int /*first*/) const override {
    if (block.mixed) {
      BridgePairs(liquid_, tension_.data(), block);
    } else {
      Bridge(liquid_, tension_.front(), block);
    }
  }

 private:
  Liquid liquid_;
  std::vector<double> tension_;  ///< per pair of materials, gamma cos(theta) [N/m]; 0: dry
};

class NoBridges final : public ContactKernel {
 public:
  void Apply(ContactBlock& /*block*/, int /*first*/) const override {}
};

std::unique_ptr<ContactKernel> Make(const KernelContext& context) {
  std::vector<double> tension = PairValues(context, "surface_tension");
  if (std::all_of(tension.begin(), tension.end(), [](double one) { return one == 0; })) {
    return std::make_unique<NoBridges>();
  }
  const double angle = context.parameters.Get("contact_angle");
  for (double& one : tension) {
    one *= Cosine(angle);
  }
  Liquid liquid{.stretch = 1.0 + 0.5 * angle};
  if (const auto volume = context.parameters.Find("liquid_volume")) {
    liquid.volume = *volume;
  } else {
    liquid.ratio = context.parameters.Get("volume_ratio");
  }
  return std::make_unique<BridgeKernel>(liquid, std::move(tension));
}

std::vector<ParameterInfo> Parameters() {
  ParameterInfo tension;
  tension.name = "surface_tension";
  tension.unit = "N/m";
  tension.max = 1e6;
  tension.default_prior = {.kind = "log_uniform", .min = 1e-3, .max = 10};
  tension.null_value = 0;
  tension.of_pairs = true;
  tension.scale = {.pressure = 1, .diameter = 1};  // force over p d^2 is then pi
  tension.scaled_prior = DefaultPrior{.kind = "log_uniform", .min = 0.003, .max = 10};
  tension.description = "gamma of the liquid (water 0.073)";
  ParameterInfo ratio;
  ratio.name = "volume_ratio";
  ratio.unit = "1";
  ratio.min = 1e-9;
  ratio.max = 0.1;
  ratio.default_prior = {.kind = "log_uniform", .min = 1e-5, .max = 1e-2};
  ratio.description = "volume of a bridge over R^3, R = 2 r1 r2/(r1 + r2)";
  ParameterInfo volume;
  volume.name = "liquid_volume";
  volume.unit = "m^3";
  volume.max = 1e-3;
  volume.min_open = true;
  volume.default_prior = {.kind = "log_uniform", .min = 1e-16, .max = 1e-9};
  volume.scale = {.factor = 1e-3, .diameter = 3};
  volume.scaled_prior = DefaultPrior{.kind = "log_uniform", .min = 0.01, .max = 10};
  volume.alternative_to = "volume_ratio";
  volume.description = "volume of every bridge, whatever the grains";
  ParameterInfo angle;
  angle.name = "contact_angle";
  angle.unit = "rad";
  angle.max = 0.9;
  angle.default_prior = {.kind = "uniform", .min = 0, .max = 0.9};
  angle.default_value = 0;
  angle.description = "theta between liquid and grain";
  return {tension, ratio, volume, angle};
}

}  // namespace

/// With R = 2 r1 r2/(r1 + r2) (Derjaguin), gap s = max(0, -u), bridge volume V, contact angle
/// theta:
///   F = 2 pi R gamma cos(theta) / (1 + 1.05 S + 2.5 S^2),  S = s sqrt(R/V)
///                                                        [Willett et al. 2000, Eq. 12]
///   rupture at s = (1 + theta/2) V^(1/3)                 [Lian et al. 1993]
/// V is `liquid_volume` per bridge or `volume_ratio` R^3. A bridge forms when grains touch, with
/// its full volume (liquid is neither counted nor shared), and is gone after rupture until they
/// touch again. The closed form holds for V < 0.01 R^3 and theta < 50 degrees. Sliding limit
/// tan(phi_mu) times the force between the solids. Pairs across a gap are no contacts in the
/// coordination number, but their force is part of stress. One-sided, vanishes at gamma = 0.
EffectEntry CapillaryBridges() {
  return {
      .info = {.name = "capillary_bridges",
               .kind = "contact",
               .description =
                   "Liquid bridges: F = 2 pi R gamma cos(theta)/(1 + 1.05 S + 2.5 S^2), S = gap "
                   "sqrt(R/V), formed on touching, ruptured at (1 + theta/2) V^(1/3); "
                   "one-sided, vanishes at surface_tension 0",
               .contacts = {},
               .parameters = Parameters(),
               .reference = "Willett et al., Langmuir 16 (2000) 9396, Eq. 12; Lian, Thornton & "
                            "Adams, J. Colloid Interface Sci. 161 (1993) 138",
               .family = "adhesion",
               .two_sided = false,
               .rays = {{.parameter = "surface_tension",
                         .steps = {0.05, 0.2},
                         .held = {{"volume_ratio", 1e-3}}}}},
      .place = 80,
      .kernels = {{.stage = ContactStage::kNormalExtra, .make = &Make}}};
}

}  // namespace calib::dem
