#include "dem/contact/linear.h"

#include "dem/contact/common_parameters.h"
#include "dem/contact/simd.h"

namespace calib::dem {
namespace {

struct LinearModuli {
  double normal = 0;  ///< 2E [Pa]
  double ratio = 0;   ///< ks/kn [-]
};

CALIB_DEM_CLONES void EvaluateLinear(const LinearModuli moduli, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    const bool on = b.overlap[k] > 0;  // a bridge may hold a contact across a gap
    const double kn = on ? moduli.normal * b.effective_radius[k] : 0.0;  // Eq. 3
    b.normal_force[k] = kn * (on ? b.overlap[k] : 0.0);                  // Eq. 1
    b.normal_stiffness[k] = kn;
    b.tangential_stiffness[k] = moduli.ratio * kn;  // Eq. 4
  }
}

class LinearKernel final : public ContactKernel {
 public:
  explicit LinearKernel(const LinearModuli& moduli) : moduli_(moduli) {}
  void Apply(ContactBlock& block, int /*first*/) const override { EvaluateLinear(moduli_, block); }

 private:
  LinearModuli moduli_;
};

std::unique_ptr<ContactKernel> Make(const KernelContext& context) {
  return std::make_unique<LinearKernel>(
      LinearModuli{.normal = 2.0 * context.parameters.Get("young_modulus"),
                   .ratio = context.parameters.Get("poisson_ratio")});
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
               .reference = "Cheng et al. 2018, Eqs. 1-4, Table 1"},
      .make = &Make};
}

}  // namespace calib::dem
