// `hertz_nonlinearity`: an exponent of the contact force other than that of the law.

#include <utility>
#include <vector>

#include "dem/contact/materials.h"
#include "dem/contact/simd.h"
#include "dem/effects/shared/parameters.h"
#include "dem/elementary/power.h"
#include "dem/model/effect.h"

namespace calib::dem {
namespace {

struct Exponent {
  double force = 0;      ///< (n - m)/m
  double stiffness = 1;  ///< n/m
  double least = 0;      ///< F/F(u_ref) below which the factor is held
};

CALIB_DEM_INLINE void BendLane(const Exponent& law, double reference_pressure, int k,
                               ContactBlock& b) {
  const double size = 4.0 * b.effective_radius[k];
  const double load = b.normal_force[k] / (reference_pressure * size * size);
  const double factor = Power(load > law.least ? load : law.least, law.force);
  const double tangent = load > law.least ? law.stiffness * factor : factor;
  b.normal_force[k] *= factor;
  b.normal_stiffness[k] *= tangent;
  b.tangential_stiffness[k] *= tangent;
}

CALIB_DEM_CLONES void Bend(const Exponent law, double reference_pressure, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    BendLane(law, reference_pressure, k, b);
  }
}

CALIB_DEM_CLONES void BendPairs(const Exponent* law, double reference_pressure, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    BendLane(law[b.materials[k]], reference_pressure, k, b);
  }
}

class NonlinearityKernel final : public ContactKernel {
 public:
  NonlinearityKernel(std::vector<Exponent> laws, double reference_pressure)
      : laws_(std::move(laws)), reference_pressure_(reference_pressure) {}
  void Apply(ContactBlock& block, int /*first*/) const override {
    if (block.mixed) {
      BendPairs(laws_.data(), reference_pressure_, block);
    } else {
      Bend(laws_.front(), reference_pressure_, block);
    }
  }

 private:
  std::vector<Exponent> laws_;  ///< per pair of materials
  double reference_pressure_;   ///< [Pa]
};

std::unique_ptr<ContactKernel> Make(const KernelContext& context) {
  const double base = context.linear_springs ? 1.0 : 1.5;  // of the law itself
  std::vector<Exponent> laws;
  for (const double exponent : PairValues(context, "exponent")) {
    laws.push_back({.force = (exponent - base) / base,
                    .stiffness = exponent / base,
                    .least = exponent < base ? 1e-3 : 1e-12});
  }
  return std::make_unique<NonlinearityKernel>(std::move(laws),
                                              context.parameters.Get("reference_pressure"));
}

}  // namespace

///   F = F_b(u_ref) (u/u_ref)^n,   ks = ks_b (dF/du)/(dF_b/du),   F_b(u_ref) = p_ref d*^2,
///   d* = 4 r* (= d of equal grains)
/// F_b is the force of the law, of exponent m (linear: 1, hertz_mindlin: 3/2), and u_ref the
/// overlap at which it carries the force that a reference pressure puts on a contact: about p d^2,
/// since p = Z phi F/(pi d^2) [Rumpf 1958] with coordination number times solid fraction near pi.
/// In terms of the law's force F = F_b (F_b/(p_ref d*^2))^((n-m)/m), so no modulus enters.
/// The shear stiffness goes with the tangent of the force: for elastic bodies of any axisymmetric
/// profile their ratio is that of Mindlin, 2(1-nu)/(2-nu).
/// [Jaeger, Arch. Appl. Mech. 65 (1995) 478]
/// Two-sided, vanishes at n = m. Below a thousandth of the reference force (n < m) the factor
/// is held, since stiffness would grow without bound as u -> 0: force and tangent are there those
/// of the law times the factor.
/// [Walton 1987; Agnolin & Roux 2007, sec. II, the exponent in moduli of packings]
EffectEntry HertzNonlinearity() {
  ParameterInfo exponent;
  exponent.name = "exponent";
  exponent.unit = "1";
  exponent.min = 0.5;
  exponent.max = 4;
  exponent.default_prior = {.kind = "uniform", .min = 0.75, .max = 3};
  exponent.null_value = 1.5;
  exponent.of_pairs = true;
  exponent.null_by_contact = {{"linear", 1.0}, {"hertz_mindlin", 1.5}};
  exponent.description =
      "n in F ~ u^n; 1 linear, 1.5 Hertz, 2 to 3 rough or conical; null 1 with linear, 1.5 with "
      "hertz_mindlin";
  return {
      .info = {.name = "hertz_nonlinearity",
               .kind = "contact",
               .description =
                   "F = F_law(u_ref) (u/u_ref)^n with F_law(u_ref) = p_ref (4 r*)^2, shear "
                   "stiffness in proportion to dF/du; two-sided, vanishes at the exponent of the "
                   "law (linear 1, hertz_mindlin 1.5)",
               .contacts = {"hertz_mindlin", "linear"},
               .parameters = {exponent, ReferencePressure(
                                            "p_ref, at which forces are those of the law itself")},
               .reference = "Walton, J. Mech. Phys. Solids 35 (1987) 213; Agnolin & Roux, "
                            "Phys. Rev. E 76 (2007) 061304",
               .two_sided = true,
               .rays = {{.parameter = "exponent",
                         .steps = {0.2, 0.4},
                         .held = {{"reference_pressure", 1}}}}},
      .place = 30,
      .kernels = {{.stage = ContactStage::kNormalExtra, .make = &Make}}};
}

}  // namespace calib::dem
