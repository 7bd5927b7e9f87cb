// `rolling_resistance`: a bending moment against relative rolling, elastic up to a limit.

#include <cmath>
#include <utility>
#include <vector>

#include "dem/contact/contact_kinematics.h"
#include "dem/contact/simd.h"
#include "dem/effects/shared/moment_stiffness.h"
#include "dem/model/effect.h"

namespace calib::dem {
namespace {

CALIB_DEM_CLONES void IntegrateRolling(const MomentResponse& response, ContactBlock& b, int first) {
  double* const hx = b.history[first];
  double* const hy = b.history[first + 1];
  double* const hz = b.history[first + 2];
#pragma GCC ivdep
  for (int k = 0; k < kBlock; ++k) {
    const double stiffness = response.stiffness[k];
    const double limit = response.limit[k];
    double x = hx[k];
    double y = hy[k];
    double z = hz[k];
    TransportLane(b, k, x, y, z);
    x -= stiffness * b.roll_x[k];
    y -= stiffness * b.roll_y[k];
    z -= stiffness * b.roll_z[k];
    const double size = std::sqrt(x * x + y * y + z * z);
    const double cut = size > limit ? limit / size : 1.0;
    hx[k] = cut * x;
    hy[k] = cut * y;
    hz[k] = cut * z;
    b.mx[k] += cut * x;
    b.my[k] += cut * y;
    b.mz[k] += cut * z;
    b.rolling_stiffness[k] += stiffness;
  }
}

class RollingKernel final : public ContactKernel {
 public:
  explicit RollingKernel(std::vector<MomentLaw> laws) : laws_(std::move(laws)) {}
  [[nodiscard]] int HistorySize() const override { return 3; }
  void Apply(ContactBlock& block, int first) const override {
    MomentResponse response;
    EvaluateMoment(laws_, block, response);
    IntegrateRolling(response, block, first);
  }

 private:
  std::vector<MomentLaw> laws_;  ///< per pair of materials
};

std::unique_ptr<ContactKernel> Make(const KernelContext& context) {
  return std::make_unique<RollingKernel>(MomentLawsFrom(context));
}

}  // namespace

///   dM = k_m dtheta,  dtheta = (w2 - w1) without its normal part, times dt;   |M| <= eta Fn l
///   hertz_mindlin: k_m = stiffness [N m/rad] or stiffness_ratio r1 r2 ks (current ks),
///                  l = (r1 + r2)/2
///   linear:        k_m = stiffness r1 r2 ks (stiffness_ratio is the same),
///                  l = min(r1, r2)
/// M is carried along with the contact like the shear force. Vanishes at stiffness 0 or friction 0.
/// [Cheng 2018, Table 1]
EffectEntry RollingResistance() {
  return {
      .info = {.name = "rolling_resistance",
               .kind = "contact",
               .description = "Bending moment dM = k_m dtheta against relative rolling, |M| <= eta "
                              "Fn l; one-sided, vanishes at stiffness 0 or friction 0",
               .contacts = {},
               .parameters = MomentParameters("rolling"),
               .reference = "Cheng et al. 2018, Table 1; Iwashita & Oda, J. Eng. Mech. 124 "
                            "(1998) 285",
               .family = "rotation",
               .two_sided = false,
               .rays = MomentRays()},
      .place = 110,
      .kernels = {{.stage = ContactStage::kMoment, .make = &Make}}};
}

}  // namespace calib::dem
