// `adhesion_dmt`: a constant attraction of touching grains.

#include <numbers>
#include <utility>
#include <vector>

#include "dem/contact/materials.h"
#include "dem/contact/simd.h"
#include "dem/effects/shared/parameters.h"
#include "dem/model/effect.h"

namespace calib::dem {
namespace {

CALIB_DEM_INLINE void AttractLane(double work, int k, ContactBlock& b) {
  const double pull_off = 2.0 * std::numbers::pi * work * b.effective_radius[k];
  const double pull = b.overlap[k] > 0 ? pull_off : 0.0;
  b.normal_force[k] -= pull;
  b.attraction[k] += pull;
}

CALIB_DEM_CLONES void Attract(double work, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    AttractLane(work, k, b);
  }
}

CALIB_DEM_CLONES void AttractPairs(const double* work, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    AttractLane(work[b.materials[k]], k, b);
  }
}

class DmtKernel final : public ContactKernel {
 public:
  explicit DmtKernel(std::vector<double> work) : work_(std::move(work)) {}
  void Apply(ContactBlock& block, int /*first*/) const override {
    if (block.mixed) {
      AttractPairs(work_.data(), block);
    } else {
      Attract(work_.front(), block);
    }
  }

 private:
  std::vector<double> work_;  ///< per pair of materials [J/m^2]
};

std::unique_ptr<ContactKernel> Make(const KernelContext& context) {
  return std::make_unique<DmtKernel>(PairValues(context, "work_of_adhesion"));
}

}  // namespace

///   F = F_b - F_p,   F_p = 2 pi W R*,   |Fs| <= tan(phi_mu) (F + F_p),   R* = r1 r2/(r1 + r2)
/// Stiff, small grains: attraction acts around the contact and does not change its profile; it ends
/// with the contact. W is the work of adhesion [J/m^2]; codes that use the surface energy gamma
/// have W = 2 gamma. One-sided, vanishes at W = 0. [Derjaguin, Muller & Toporov 1975]
EffectEntry AdhesionDmt() {
  return {
      .info = {.name = "adhesion_dmt",
               .kind = "contact",
               .description = "Attraction 2 pi W R* while grains touch, sliding limit mu (F + 2 "
                              "pi W R*); one-sided, vanishes at work_of_adhesion 0",
               .contacts = {},
               .parameters = {WorkOfAdhesion()},
               .reference = "Derjaguin, Muller & Toporov, J. Colloid Interface Sci. 53 (1975) "
                            "314",
               .family = "adhesion",
               .two_sided = false,
               .rays = {{.parameter = "work_of_adhesion", .steps = {0.1, 0.4}}}},
      .place = 60,
      .kernels = {{.stage = ContactStage::kNormalExtra, .make = &Make}}};
}

}  // namespace calib::dem
