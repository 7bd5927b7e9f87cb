// `linear_cohesion`: attraction in proportion to the area of contact.

#include <numbers>
#include <utility>
#include <vector>

#include "dem/contact/materials.h"
#include "dem/contact/simd.h"
#include "dem/model/effect.h"

namespace calib::dem {
namespace {

CALIB_DEM_INLINE void AttractLane(double density, int k, ContactBlock& b) {
  const double u = b.overlap[k] > 0 ? b.overlap[k] : 0.0;
  const double pull = 2.0 * std::numbers::pi * density * (b.effective_radius[k] * u);
  b.normal_force[k] -= pull;
  b.attraction[k] += pull;
}

CALIB_DEM_CLONES void Attract(double density, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    AttractLane(density, k, b);
  }
}

CALIB_DEM_CLONES void AttractPairs(const double* density, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    AttractLane(density[b.materials[k]], k, b);
  }
}

class CohesionKernel final : public ContactKernel {
 public:
  explicit CohesionKernel(std::vector<double> density) : density_(std::move(density)) {}
  void Apply(ContactBlock& block, int /*first*/) const override {
    if (block.mixed) {
      AttractPairs(density_.data(), block);
    } else {
      Attract(density_.front(), block);
    }
  }

 private:
  std::vector<double> density_;  ///< per pair of materials [J/m^3]
};

std::unique_ptr<ContactKernel> Make(const KernelContext& context) {
  return std::make_unique<CohesionKernel>(PairValues(context, "energy_density"));
}

}  // namespace

///   F = F_b - C A,   A = 2 pi r* u
/// A is the circle in which two spheres cut each other, to first order, C a cohesion energy density
/// [J/m^3 = Pa]. Sliding limit tan(phi_mu) (F + C A). With linear contacts CA/F_b = pi C/E whatever
/// the load: a softer spring with more friction. Hertz contacts, whose force falls faster than
/// their area, are held together below an overlap of r* (2 pi C/(kn/sqrt(r* u)))^2. One-sided,
/// vanishes at C = 0. Acts while grains overlap.
/// [Luding 2008, sec. 2.2.2, on tension that grows with overlap; Johnson 1985, sec. 5.5]
EffectEntry LinearCohesion() {
  ParameterInfo density;
  density.name = "energy_density";
  density.unit = "J/m^3";
  density.max = 1e12;
  density.default_prior = {.kind = "log_uniform", .min = 1e3, .max = 1e8};
  density.null_value = 0;
  density.of_pairs = true;
  // With Hertz contacts carrying p d^2 the attraction is about the tenth part of the force there.
  density.scale = {.factor = 0.03, .pressure = 1.0 / 3.0, .modulus = 2.0 / 3.0};
  density.scaled_prior = DefaultPrior{.kind = "log_uniform", .min = 0.01, .max = 10};
  density.description = "C, attraction over the area of contact";
  return {.info = {.name = "linear_cohesion",
                   .kind = "contact",
                   .description = "Attraction C A with A = 2 pi r* u, sliding limit mu (F + C A); "
                                  "one-sided, vanishes at energy_density 0",
                   .contacts = {},
                   .parameters = {density},
                   .reference = "Luding, Granular Matter 10 (2008) 235, sec. 2.2; Johnson, Contact "
                                "Mechanics (1985), sec. 5.5",
                   .family = "adhesion",
                   .two_sided = false,
                   .rays = {{.parameter = "energy_density", .steps = {1, 3}}}},
          .place = 50,
          .kernels = {{.stage = ContactStage::kNormalExtra, .make = &Make}}};
}

}  // namespace calib::dem
