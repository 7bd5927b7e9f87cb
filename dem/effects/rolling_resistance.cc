#include "dem/effects/rolling_resistance.h"

#include <cmath>

#include "dem/contact/contact_kinematics.h"
#include "dem/contact/simd.h"
#include "dem/effects/moment_stiffness.h"

namespace calib::dem {
namespace {

CALIB_DEM_CLONES void IntegrateRolling(const MomentLaw law, ContactBlock& b, int first) {
  double* const hx = b.history[first];
  double* const hy = b.history[first + 1];
  double* const hz = b.history[first + 2];
#pragma GCC ivdep
  for (int k = 0; k < kBlock; ++k) {
    const MomentResponse response = Evaluate(law, b, k);
    const double x = hx[k] - response.stiffness * b.roll_x[k];
    const double y = hy[k] - response.stiffness * b.roll_y[k];
    const double z = hz[k] - response.stiffness * b.roll_z[k];
    const double size = std::sqrt(x * x + y * y + z * z);
    const double cut = size > response.limit ? response.limit / size : 1.0;
    hx[k] = cut * x;
    hy[k] = cut * y;
    hz[k] = cut * z;
    b.mx[k] += hx[k];
    b.my[k] += hy[k];
    b.mz[k] += hz[k];
    b.rolling_stiffness[k] += response.stiffness;
  }
}

class RollingKernel final : public ContactKernel {
 public:
  explicit RollingKernel(const MomentLaw& law) : law_(law) {}
  [[nodiscard]] int HistorySize() const override { return 3; }
  void Apply(ContactBlock& block, int first) const override {
    TransportTangential(block, first);
    IntegrateRolling(law_, block, first);
  }

 private:
  MomentLaw law_;
};

std::unique_ptr<ContactKernel> Make(const KernelContext& context) {
  return std::make_unique<RollingKernel>(MomentLawFrom(context));
}

}  // namespace

EffectEntry RollingResistance() {
  return {
      .info = {.name = "rolling_resistance",
               .kind = "contact",
               .description = "Bending moment dM = k_m dtheta against relative rolling, |M| <= eta "
                              "Fn l; one-sided, vanishes at stiffness 0 or friction 0",
               .contacts = {},
               .parameters = MomentParameters("rolling"),
               .reference = "Cheng et al. 2018, Table 1; Iwashita & Oda, J. Eng. Mech. 124 "
                            "(1998) 285"},
      .stage = ContactStage::kMoment,
      .make = &Make};
}

}  // namespace calib::dem
