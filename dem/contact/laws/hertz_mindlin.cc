#include "dem/contact/laws/hertz_mindlin.h"

#include <cmath>
#include <utility>

#include "dem/contact/common_parameters.h"
#include "dem/contact/contact_kernel.h"
#include "dem/contact/materials.h"
#include "dem/contact/quad.h"
#include "dem/contact/simd.h"

namespace calib::dem {
namespace {

struct HertzModuli {
  double normal = 0;      ///< 2E / (3(1 - nu^2)) [Pa]
  double tangential = 0;  ///< 2E / ((1 + nu)(2 - nu)) [Pa]
};

CALIB_DEM_INLINE void HertzLane(const HertzModuli moduli, int k, ContactBlock& b) {
  const double u = b.overlap[k] > 0 ? b.overlap[k] : 0.0;
  const double contact_radius = std::sqrt(b.effective_radius[k] * u);
  const double kn = moduli.normal * contact_radius;  // Eq. 5
  b.normal_force[k] = kn * u;                        // Eq. 1
  b.normal_stiffness[k] = 1.5 * kn;
  b.tangential_stiffness[k] = moduli.tangential * contact_radius;  // Eq. 6
}

CALIB_DEM_CLONES void EvaluateHertz(const HertzModuli moduli, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    HertzLane(moduli, k, b);
  }
}

CALIB_DEM_CLONES void EvaluateHertzPairs(const HertzModuli* moduli, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    HertzLane(moduli[b.materials[k]], k, b);
  }
}

class HertzKernel final : public ContactKernel {
 public:
  explicit HertzKernel(std::vector<HertzModuli> moduli) : moduli_(std::move(moduli)) {}
  void Apply(ContactBlock& block, int /*first*/) const override {
    if (block.mixed) {
      EvaluateHertzPairs(moduli_.data(), block);
    } else {
      EvaluateHertz(moduli_.front(), block);
    }
  }

 private:
  std::vector<HertzModuli> moduli_;  ///< per pair of materials
};

HertzModuli AmongEquals(const ParameterSet& law) {
  const double e = law.Get("young_modulus");
  const double nu = law.Get("poisson_ratio");
  return {.normal = 2.0 * e / (3.0 * (1.0 - nu * nu)),
          .tangential = 2.0 * e / ((1.0 + nu) * (2.0 - nu))};
}

std::unique_ptr<ContactKernel> Make(const KernelContext& context) {
  return std::make_unique<HertzKernel>(
      ForPairs<HertzModuli>(context, &AmongEquals, [](const HertzModuli& a, const HertzModuli& b) {
        return HertzModuli{.normal = InSeries(a.normal, b.normal),
                           .tangential = InSeries(a.tangential, b.tangential)};
      }));
}

}  // namespace

ContactEntry HertzMindlin() {
  return {
      .info = {.name = "hertz_mindlin",
               .description =
                   "Elastic spheres: kn = 2E/(3(1-nu^2)) sqrt(r* u), Fn = kn u; "
                   "ks = 2E/((1+nu)(2-nu)) sqrt(r* u), dFs = ks dus; |Fs| <= tan(phi_mu) Fn",
               .parameters = {YoungModulus(), PoissonRatio(), FrictionAngle(),
                              FrictionCoefficient()},
               .reference = "Cheng et al. 2018, Eqs. 1-2 and 5-6, Table 1; Johnson, Contact "
                            "Mechanics (1985), sec. 4.2; Mindlin, J. Appl. Mech. 16 (1949) 259"},
      .place = 10,
      .make = &Make};
}

}  // namespace calib::dem
