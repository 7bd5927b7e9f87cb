#include "dem/contact/laws/linear.h"

#include <utility>

#include "dem/contact/common_parameters.h"
#include "dem/contact/contact_kernel.h"
#include "dem/contact/materials.h"
#include "dem/contact/quad.h"
#include "dem/contact/simd.h"

namespace calib::dem {
namespace {

struct LinearModuli {
  double normal = 0;  ///< 2E [Pa]
  double ratio = 0;   ///< ks/kn [-]
};

CALIB_DEM_INLINE void LinearLane(const LinearModuli moduli, int k, ContactBlock& b) {
  const bool on = b.overlap[k] > 0;  // a bridge may hold a contact across a gap
  const double kn = on ? moduli.normal * b.effective_radius[k] : 0.0;  // Eq. 3
  b.normal_force[k] = kn * (on ? b.overlap[k] : 0.0);                  // Eq. 1
  b.normal_stiffness[k] = kn;
  b.tangential_stiffness[k] = moduli.ratio * kn;  // Eq. 4
}

CALIB_DEM_CLONES void EvaluateLinear(const LinearModuli moduli, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    LinearLane(moduli, k, b);
  }
}

CALIB_DEM_CLONES void EvaluateLinearPairs(const LinearModuli* moduli, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    LinearLane(moduli[b.materials[k]], k, b);
  }
}

class LinearKernel final : public ContactKernel {
 public:
  explicit LinearKernel(std::vector<LinearModuli> moduli) : moduli_(std::move(moduli)) {}
  void Apply(ContactBlock& block, int /*first*/) const override {
    if (block.mixed) {
      EvaluateLinearPairs(moduli_.data(), block);
    } else {
      EvaluateLinear(moduli_.front(), block);
    }
  }

 private:
  std::vector<LinearModuli> moduli_;  ///< per pair of materials
};

LinearModuli AmongEquals(const ParameterSet& law) {
  return {.normal = 2.0 * law.Get("young_modulus"), .ratio = law.Get("poisson_ratio")};
}

/// kn and ks each in series.
LinearModuli OfPair(const LinearModuli& a, const LinearModuli& b) {
  const double normal = InSeries(a.normal, b.normal);
  return {.normal = normal,
          .ratio = a.ratio == b.ratio ? a.ratio
                                      : InSeries(a.normal * a.ratio, b.normal * b.ratio) / normal};
}

std::unique_ptr<ContactKernel> Make(const KernelContext& context) {
  return std::make_unique<LinearKernel>(ForPairs<LinearModuli>(context, &AmongEquals, &OfPair));
}

}  // namespace

ContactEntry Linear() {
  ParameterInfo ratio;
  ratio.name = "poisson_ratio";
  ratio.unit = "1";
  ratio.min = 0;
  ratio.max = 2;
  ratio.default_prior = {.kind = "uniform", .min = 0, .max = 1};
  ratio.default_value = 0.25;
  ratio.description =
      "ratio ks/kn of the tangential to the normal stiffness (not a Poisson's ratio)";
  return {
      .info = {.name = "linear",
               .description = "Linear springs: kn = 2E r*, Fn = kn u; ks = 2E nu r*, dFs = ks dus; "
                              "|Fs| <= tan(phi_mu) Fn; nu = ks/kn is given as poisson_ratio",
               .parameters = {YoungModulus(), ratio, FrictionAngle(), FrictionCoefficient()},
               .reference = "Cheng et al. 2018, Eqs. 1-4, Table 1",
               .linear_springs = true},
      .place = 20,
      .make = &Make};
}

}  // namespace calib::dem
