// `contact_plasticity`: contacts that unload stiffer than they load.

#include <algorithm>
#include <utility>
#include <vector>

#include "dem/contact/materials.h"
#include "dem/contact/simd.h"
#include "dem/model/effect.h"

namespace calib::dem {
namespace {

CALIB_DEM_INLINE void YieldLane(double stiffer, int k, double* largest, ContactBlock& b) {
  const double force = b.normal_force[k];
  const double most = force > largest[k] ? force : largest[k];
  const double unloading = force - stiffer * (most - force);
  largest[k] = most;
  b.normal_force[k] = unloading > 0 ? unloading : 0.0;
  const double loading = b.normal_stiffness[k];
  b.normal_stiffness[k] = force < most ? loading * (1.0 + stiffer) : loading;
  b.may_stiffen[k] = force < most ? 0.0 : loading * stiffer;
}

CALIB_DEM_CLONES void Yield(double stiffer, ContactBlock& b, int first) {
  double* const largest = b.history[first];
#pragma GCC ivdep
  for (int k = 0; k < kBlock; ++k) {
    YieldLane(stiffer, k, largest, b);
  }
}

CALIB_DEM_CLONES void YieldPairs(const double* stiffer, ContactBlock& b, int first) {
  double* const largest = b.history[first];
#pragma GCC ivdep
  for (int k = 0; k < kBlock; ++k) {
    YieldLane(stiffer[b.materials[k]], k, largest, b);
  }
}

class PlasticityKernel final : public ContactKernel {
 public:
  explicit PlasticityKernel(std::vector<double> stiffer) : stiffer_(std::move(stiffer)) {}
  [[nodiscard]] int HistorySize() const override { return 1; }
  [[nodiscard]] double Stiffening() const override {
    return 1.0 + *std::max_element(stiffer_.begin(), stiffer_.end());
  }
  void Apply(ContactBlock& block, int first) const override {
    if (block.mixed) {
      YieldPairs(stiffer_.data(), block, first);
    } else {
      Yield(stiffer_.front(), block, first);
    }
  }

 private:
  std::vector<double> stiffer_;  ///< kappa - 1 per pair of materials
};

std::unique_ptr<ContactKernel> Make(const KernelContext& context) {
  std::vector<double> stiffer = PairValues(context, "stiffness_ratio");
  for (double& ratio : stiffer) {
    ratio -= 1.0;
  }
  return std::make_unique<PlasticityKernel>(std::move(stiffer));
}

}  // namespace

///   F = F_b                                     while F_b >= F_max (loading; F_max := F_b)
///   F = max(0, F_b - (kappa - 1)(F_max - F_b))  below, of stiffness kappa dF_b/du
/// F_b(u) is the force of the law, F_max the largest that the contact has carried since it formed,
/// kappa = k2/k1 >= 1. With linear contacts this is the hysteretic spring: loading k1, unloading
/// k2, zero force at u0 = (1 - k1/k2) u_max, restitution 1/sqrt(kappa).
/// [Walton & Braun 1986; Luding 2008, sec. 2.2 without adhesion]
/// Shear stiffness stays that of the law. One-sided,
/// vanishes at kappa = 1. A contact that opens forgets; until then it counts as a contact, with or
/// without force.
EffectEntry ContactPlasticity() {
  ParameterInfo ratio;
  ratio.name = "stiffness_ratio";
  ratio.unit = "1";
  ratio.min = 1;
  ratio.max = 100;
  ratio.default_prior = {.kind = "log_uniform", .min = 1, .max = 11};
  ratio.null_value = 1;
  ratio.of_pairs = true;
  ratio.description = "kappa = k2/k1, stiffness of unloading over that of first loading";
  return {.info = {.name = "contact_plasticity",
                   .kind = "contact",
                   .description =
                       "Hysteretic normal force on any law: F = F_law while it grows, F = max(0, "
                       "F_law - (kappa-1)(F_max - F_law)) below the largest F_law so far; "
                       "one-sided, vanishes at stiffness_ratio 1",
                   .contacts = {},
                   .parameters = {ratio},
                   .reference = "Walton & Braun, J. Rheol. 30 (1986) 949; Luding, Granular Matter "
                                "10 (2008) 235, sec. 2.2",
                   .two_sided = false,
                   .rays = {{.parameter = "stiffness_ratio", .steps = {0.5, 2}}}},
          .place = 40,
          .kernels = {{.stage = ContactStage::kNormalExtra, .make = &Make}}};
}

}  // namespace calib::dem
