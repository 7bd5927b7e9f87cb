#include "dem/contact/viscoelastic.h"

#include <cmath>

#include "dem/contact/common_parameters.h"
#include "dem/contact/power.h"
#include "dem/contact/simd.h"

namespace calib::dem {
namespace {

struct Springs {
  double normal = 0;      ///< 4/3 E* [Pa]
  double tangential = 0;  ///< k_t [N/m]
};

CALIB_DEM_CLONES void EvaluateSprings(const Springs springs, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    const double u = b.overlap[k] > 0 ? b.overlap[k] : 0.0;
    const double secant = springs.normal * std::sqrt(b.effective_radius[k] * u);
    b.normal_force[k] = secant * u;
    b.normal_stiffness[k] = 1.5 * secant;
    b.tangential_stiffness[k] = springs.tangential;
  }
}

/// u^alpha of every lane, zero where nothing overlaps.
CALIB_DEM_CLONES void RaiseOverlap(const ViscoelasticExponent& exponent, const ContactBlock& b,
                                   double* __restrict raised) {
  if (exponent.kind == ViscoelasticExponent::Kind::kGiven) {
    for (int k = 0; k < kBlock; ++k) {
      const double u = b.overlap[k] > 1e-300 ? b.overlap[k] : 1e-300;
      raised[k] = b.overlap[k] > 0 ? Power(u, exponent.value) : 0.0;
    }
    return;
  }
  for (int k = 0; k < kBlock; ++k) {
    raised[k] = std::sqrt(b.overlap[k] > 0 ? b.overlap[k] : 0.0);
  }
  if (exponent.kind == ViscoelasticExponent::Kind::kQuarter) {
    for (int k = 0; k < kBlock; ++k) {
      raised[k] = std::sqrt(raised[k]);
    }
  }
}

CALIB_DEM_CLONES void Damp(double damping, const double* __restrict raised, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    const double c = damping * raised[k];
    b.normal_force[k] -= c * b.normal_velocity[k];
    b.normal_damping[k] += c;
    // The Coulomb limit takes |F|: what pulls is turned into load.
    const double load = b.normal_force[k] + b.attraction[k];
    b.attraction[k] -= load < 0 ? 2.0 * load : 0.0;
  }
}

class SpringsKernel final : public ContactKernel {
 public:
  explicit SpringsKernel(const Springs& springs) : springs_(springs) {}
  void Apply(ContactBlock& block, int /*first*/) const override {
    EvaluateSprings(springs_, block);
  }

 private:
  Springs springs_;
};

class DashpotKernel final : public ContactKernel {
 public:
  DashpotKernel(double damping, const ViscoelasticExponent& exponent)
      : damping_(damping), exponent_(exponent) {}
  void Apply(ContactBlock& block, int /*first*/) const override {
    ContactBlock::Lane raised;
    RaiseOverlap(exponent_, block, raised);
    Damp(damping_ * block.viscous, raised, block);
  }

 private:
  double damping_;  ///< gamma [N s/m^(1 + alpha)]
  ViscoelasticExponent exponent_;
};

}  // namespace

std::unique_ptr<ContactKernel> MakeViscoelasticSprings(const KernelContext& context) {
  const double e = context.parameters.Get("young_modulus");
  const double nu = context.parameters.Get("poisson_ratio");
  return std::make_unique<SpringsKernel>(
      Springs{.normal = 2.0 * e / (3.0 * (1.0 - nu * nu)),
              .tangential = context.parameters.Get("tangential_stiffness")});
}

std::unique_ptr<ContactKernel> MakeViscoelasticDashpot(const KernelContext& context,
                                                       const ViscoelasticExponent& exponent) {
  return std::make_unique<DashpotKernel>(context.parameters.Get("damping"), exponent);
}

std::vector<ParameterInfo> ViscoelasticParameters(const std::string& damping_unit) {
  ParameterInfo tangential;
  tangential.name = "tangential_stiffness";
  tangential.unit = "N/m";
  tangential.max = 1e15;
  tangential.default_prior = {.kind = "uniform", .min = 1e7, .max = 1.5e9};
  tangential.description = "k_t, constant stiffness of the tangential spring";
  ParameterInfo damping;
  damping.name = "damping";
  damping.unit = damping_unit;
  damping.max = 1e12;
  damping.default_prior = {.kind = "uniform", .min = 1e3, .max = 1.5e5};
  damping.description =
      "gamma, damping force over rate of overlap times overlap^alpha, in SI: N "
      "s/m^(1 + alpha)";
  return {YoungModulus(), PoissonRatio(),  tangential,
          damping,        FrictionAngle(), FrictionCoefficient()};
}

}  // namespace calib::dem
