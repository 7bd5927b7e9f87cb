// `pressure_dependent_friction`: friction that falls or grows with the load of a contact.

#include <utility>
#include <vector>

#include "dem/contact/materials.h"
#include "dem/contact/simd.h"
#include "dem/effects/shared/parameters.h"
#include "dem/elementary/power.h"
#include "dem/model/effect.h"

namespace calib::dem {
namespace {

CALIB_DEM_INLINE void ScaleLimitLane(double exponent, double reference, int k, ContactBlock& b) {
  const double size = 4.0 * b.effective_radius[k];
  const double ratio = (b.normal_force[k] + b.attraction[k]) / (reference * (size * size));
  b.sliding_limit[k] *= Power(ratio > 1e-6 ? ratio : 1e-6, exponent);
}

CALIB_DEM_CLONES void ScaleLimit(double exponent, double reference, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    ScaleLimitLane(exponent, reference, k, b);
  }
}

CALIB_DEM_CLONES void ScaleLimitPairs(const double* exponent, double reference, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    ScaleLimitLane(exponent[b.materials[k]], reference, k, b);
  }
}

class PressureFriction final : public ContactKernel {
 public:
  PressureFriction(std::vector<double> exponents, double reference)
      : exponents_(std::move(exponents)), reference_(reference) {}
  void Apply(ContactBlock& block, int /*first*/) const override {
    if (block.mixed) {
      ScaleLimitPairs(exponents_.data(), reference_, block);
    } else {
      ScaleLimit(exponents_.front(), reference_, block);
    }
  }

 private:
  std::vector<double> exponents_;  ///< -m per pair of materials
  double reference_;               ///< p_ref [Pa]
};

std::unique_ptr<ContactKernel> Make(const KernelContext& context) {
  std::vector<double> exponents = PairValues(context, "exponent");
  for (double& exponent : exponents) {
    exponent = -exponent;
  }
  return std::make_unique<PressureFriction>(std::move(exponents),
                                            context.parameters.Get("reference_pressure"));
}

}  // namespace

///   mu = tan(phi_mu) (sigma/p_ref)^(-m),   sigma = Fn/d*^2,  d* = 4 r* (= d of equal grains)
/// sigma is the contact's own nominal pressure: on average about the mean stress p of the packing,
/// since p = Z phi F/(pi d^2) [Rumpf 1958] with coordination number times solid fraction near pi.
/// In one test at one pressure this is nearly another constant friction; it shows between
/// pressures. Fn is without adhesive pull. Two-sided, vanishes at m = 0; for Hertz contacts of
/// constant shear strength per area m = 1/3. sigma/p_ref below 1e-6 counts as 1e-6.
/// [Bowden & Tabor 1950; Archard 1957]
EffectEntry PressureDependentFriction() {
  ParameterInfo exponent;
  exponent.name = "exponent";
  exponent.unit = "1";
  exponent.min = -0.9;
  exponent.max = 0.9;
  exponent.default_prior = {.kind = "uniform", .min = -0.6, .max = 0.6};
  exponent.null_value = 0;
  exponent.of_pairs = true;
  exponent.description = "m; friction falls with pressure where it is positive";
  return {.info = {.name = "pressure_dependent_friction",
                   .kind = "contact",
                   .description =
                       "mu = tan(phi_mu) (sigma/p_ref)^(-m) with the contact's nominal pressure "
                       "sigma = Fn/(4 r*)^2, about the mean stress on average; two-sided, vanishes "
                       "at exponent 0; shows between pressures",
                   .contacts = {},
                   .parameters = {exponent,
                                  ReferencePressure("p_ref, at which friction is tan(phi_mu)")},
                   .reference = "Bowden & Tabor, The Friction and Lubrication of Solids (1950); "
                                "Archard, Proc. R. Soc. Lond. A 243 (1957) 190",
                   .two_sided = true,
                   .rays = {{.parameter = "exponent",
                             .steps = {0.1, 0.25},
                             .held = {{"reference_pressure", 1}}}},
                   .across_pressures = true},
          .place = 100,
          .kernels = {{.stage = ContactStage::kSlidingLimit, .make = &Make}}};
}

}  // namespace calib::dem
