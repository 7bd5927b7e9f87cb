// `adhesion_jkr`: elastic grains with adhesion inside their circle of contact.

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "dem/contact/materials.h"
#include "dem/contact/simd.h"
#include "dem/effects/shared/parameters.h"
#include "dem/elementary/power.h"
#include "dem/model/effect.h"

namespace calib::dem {
namespace {

struct Adhesion {
  double work = 0;        ///< W [J/m^2]; 0: none
  double modulus = 0;     ///< E* [Pa]
  double tangential = 0;  ///< ks/a of the law [Pa]
};

/// Root z >= 1 of z^4 - 4z = u for u >= -3. The start lies above it and the curve is convex, so
/// that Newton's steps come down without passing it; twelve reach rounding from wherever they
/// start, except within 1e-6 of the double root z = 1, where they reach 1e-4.
inline double ContactWidth(double u) {
  double z = std::sqrt(std::sqrt(u + 3.0)) + (1.0 + 1e-9);
  for (int n = 0; n < 12; ++n) {
    const double z3 = z * z * z;
    z -= (z * (z3 - 4.0) - u) / (4.0 * (z3 - 1.0) + 1e-30);
    z = z > 1.0 ? z : 1.0;
  }
  return z;
}

/// a_c = (pi W R*^2/(8 E*))^(1/3), the smallest radius of a contact [m].
inline double SmallestRadius(const Adhesion& law, double radius) {
  return Power(std::numbers::pi * law.work * radius * radius / (8.0 * law.modulus), 1.0 / 3.0);
}

CALIB_DEM_INLINE void AdhereLane(const Adhesion& law, int k, ContactBlock& b) {
  const double radius = b.effective_radius[k];
  const double smallest = SmallestRadius(law, radius);
  const double width = smallest * smallest / radius;  // unit of overlap
  const double u = b.overlap[k] / width;
  const double z = ContactWidth(u > -3.0 ? u : -3.0);
  const double z3 = z * z * z;
  const double unit = std::numbers::pi * law.work * radius;
  const double positive = b.overlap[k] > 0 ? b.overlap[k] : 0.0;
  const double hertz_radius = std::sqrt(radius * positive);
  const double hertz = 4.0 / 3.0 * law.modulus * hertz_radius * positive;
  const double on = u > -3.0 ? 1.0 : 0.0;
  const double more = smallest * (z * z) - hertz_radius;  // of the contact radius
  b.normal_force[k] += on * (unit * (z3 * z3 / 6.0 - z3) - hertz);
  b.normal_stiffness[k] += on * (2.0 * law.modulus * more);  // bounds the tangent from above
  b.tangential_stiffness[k] += on * (law.tangential * more);
  b.attraction[k] += on * (1.5 * unit);
  b.holds[k] += on;
}

CALIB_DEM_CLONES void Adhere(const Adhesion law, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    AdhereLane(law, k, b);
  }
}

void AdherePairs(const Adhesion* laws, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    const Adhesion& law = laws[b.materials[k]];
    if (law.work > 0) {
      AdhereLane(law, k, b);
    }
  }
}

class JkrKernel final : public ContactKernel {
 public:
  explicit JkrKernel(std::vector<Adhesion> laws) : laws_(std::move(laws)) {}
  [[nodiscard]] double Reach(double largest_radius) const override {
    const double radius = 0.5 * largest_radius;
    double reach = 0;
    for (const Adhesion& law : laws_) {
      const double smallest = SmallestRadius(law, radius);
      reach = std::max(reach, 3.0 * smallest * smallest / radius);  // grows with R*^(1/3)
    }
    return reach;
  }
  void Apply(ContactBlock& block, int /*first*/) const override {
    if (block.mixed) {
      AdherePairs(laws_.data(), block);
    } else {
      Adhere(laws_.front(), block);
    }
  }

 private:
  std::vector<Adhesion> laws_;  ///< per pair of materials
};

class NoAdhesion final : public ContactKernel {
 public:
  void Apply(ContactBlock& /*block*/, int /*first*/) const override {}
};

std::unique_ptr<ContactKernel> Make(const KernelContext& context) {
  const std::vector<double> work = PairValues(context, "work_of_adhesion");
  if (std::all_of(work.begin(), work.end(), [](double one) { return one == 0; })) {
    return std::make_unique<NoAdhesion>();
  }
  std::vector<Adhesion> laws = ForPairs<Adhesion>(
      context,
      [](const ParameterSet& law) {
        const double e = law.Get("young_modulus");
        const double nu = law.Get("poisson_ratio");
        return Adhesion{.modulus = e / (2.0 * (1.0 - nu * nu)),
                        .tangential = 2.0 * e / ((1.0 + nu) * (2.0 - nu))};
      },
      [](const Adhesion& a, const Adhesion& b) {
        return Adhesion{.modulus = InSeries(a.modulus, b.modulus),
                        .tangential = InSeries(a.tangential, b.tangential)};
      });
  for (std::size_t pair = 0; pair < laws.size(); ++pair) {
    laws[pair].work = work[pair];
  }
  return std::make_unique<JkrKernel>(std::move(laws));
}

}  // namespace

/// With the contact radius a, E* = E/(2(1-nu^2)) (of two materials: in series) and R* = r1 r2/(r1 +
/// r2):
///   u = a^2/R* - sqrt(2 pi W a/E*),   F = 4 E* a^3/(3 R*) - sqrt(8 pi W E* a^3)
/// Pull-off 3/2 pi W R*. A contact forms at u = 0 with F = -4/3 pi W R* and, once formed, holds
/// down to u = -3 a_c^2/R*, a_c^3 = pi W R*^2/(8 E*), where F = -5/6 pi W R*: making and breaking
/// it costs energy. In units of a_c, with z = sqrt(a/a_c) >= 1:
///   u R*/a_c^2 = z^4 - 4z,   F/(pi W R*) = z^6/6 - z^3,
/// z by Newton's method, always from above. The difference to Hertz joins the force of the law, and
/// the shear stiffness grows with a. Sliding limit tan(phi_mu) (F + 3/2 pi W R*). One-sided,
/// vanishes at W = 0. [Johnson, Kendall & Roberts 1971; Johnson 1985, sec. 5.5]
EffectEntry AdhesionJkr() {
  return {.info = {.name = "adhesion_jkr",
                   .kind = "contact",
                   .description =
                       "Adhesion of soft elastic spheres, pull-off 3/2 pi W R*, contacts hold to a "
                       "gap of 3 a_c^2/R*, sliding limit mu (F + 3/2 pi W R*); one-sided, vanishes "
                       "at work_of_adhesion 0",
                   .contacts = {"hertz_mindlin"},
                   .parameters = {WorkOfAdhesion()},
                   .reference = "Johnson, Kendall & Roberts, Proc. R. Soc. Lond. A 324 (1971) 301; "
                                "Johnson, Contact Mechanics (1985), sec. 5.5",
                   .family = "adhesion",
                   .two_sided = false,
                   .rays = {{.parameter = "work_of_adhesion", .steps = {0.1, 0.4}}},
                   .excludes = {"adhesion_dmt"}},
          .place = 70,
          .kernels = {{.stage = ContactStage::kNormalExtra, .make = &Make}}};
}

}  // namespace calib::dem
