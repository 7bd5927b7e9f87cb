// `twisting_resistance`: a moment about the normal against relative twisting, elastic up to a
// limit.

#include <algorithm>
#include <iterator>

#include "dem/contact/simd.h"
#include "dem/effects/shared/moment_stiffness.h"
#include "dem/model/effect.h"

namespace calib::dem {
namespace {

CALIB_DEM_CLONES void IntegrateTwisting(const MomentResponse& response, ContactBlock& b,
                                        int first) {
  double* const history = b.history[first];
#pragma GCC ivdep
  for (int k = 0; k < kBlock; ++k) {
    const double stiffness = response.stiffness[k];
    const double limit = response.limit[k];
    const double trial = history[k] - stiffness * b.twist[k];
    const double upper = trial < limit ? trial : limit;
    const double moment = upper > -limit ? upper : -limit;
    history[k] = moment;
    b.mx[k] += moment * b.nx[k];
    b.my[k] += moment * b.ny[k];
    b.mz[k] += moment * b.nz[k];
    b.twisting_stiffness[k] += stiffness;
  }
}

class TwistingKernel final : public ContactKernel {
 public:
  explicit TwistingKernel(std::vector<MomentLaw> laws) : laws_(std::move(laws)) {}
  [[nodiscard]] int HistorySize() const override { return 1; }
  void Apply(ContactBlock& block, int first) const override {
    MomentResponse response;
    EvaluateMoment(laws_, block, response);
    IntegrateTwisting(response, block, first);
  }

 private:
  std::vector<MomentLaw> laws_;  ///< per pair of materials
};

std::unique_ptr<ContactKernel> Make(const KernelContext& context) {
  return std::make_unique<TwistingKernel>(MomentLawsFrom(context));
}

}  // namespace

///   dM = k_t dtheta,  dtheta = n.(w2 - w1) dt,   |M| <= eta Fn l
/// Stiffness k_t, limit and length l as in rolling_resistance, with parameters of their own (the
/// papers share one stiffness between rolling and twisting). Vanishes at stiffness 0 or friction 0.
/// [Cheng 2018, Table 1]
EffectEntry TwistingResistance() {
  return {
      .info = {.name = "twisting_resistance",
               .kind = "contact",
               .description = "Moment dM = k_t dtheta about the normal against relative twisting, "
                              "|M| <= eta Fn l; one-sided, vanishes at stiffness 0 or friction 0",
               .contacts = {},
               .parameters = MomentParameters("twisting"),
               .reference = "Cheng et al. 2018, Table 1",
               .family = "rotation",
               .two_sided = false,
               .rays = MomentRays(),
               .needs_space = true},
      .place = 120,
      .shows_in = [](const TestInfo& test) { return !test.planar; },
      .kernels = {{.stage = ContactStage::kMoment, .make = &Make}}};
}

}  // namespace calib::dem
