#include "dem/contact/viscoelastic.h"

#include <cmath>
#include <utility>

#include "dem/contact/common_parameters.h"
#include "dem/contact/materials.h"
#include "dem/contact/quad.h"
#include "dem/contact/simd.h"
#include "dem/elementary/power.h"

namespace calib::dem {
namespace {

struct Springs {
  double normal = 0;      ///< 4/3 E* [Pa]
  double tangential = 0;  ///< k_t [N/m]
};

CALIB_DEM_INLINE void SpringsLane(const Springs springs, int k, ContactBlock& b) {
  const double u = b.overlap[k] > 0 ? b.overlap[k] : 0.0;
  const double secant = springs.normal * std::sqrt(b.effective_radius[k] * u);
  b.normal_force[k] = secant * u;
  b.normal_stiffness[k] = 1.5 * secant;
  b.tangential_stiffness[k] = springs.tangential;
}

CALIB_DEM_CLONES void EvaluateSprings(const Springs springs, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    SpringsLane(springs, k, b);
  }
}

CALIB_DEM_CLONES void EvaluatePairSprings(const Springs* springs, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    SpringsLane(springs[b.materials[k]], k, b);
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

/// c [N s/m]
CALIB_DEM_INLINE void DampLane(double c, int k, ContactBlock& b) {
  b.normal_force[k] -= c * b.normal_velocity[k];
  b.normal_damping[k] += c;
  // The Coulomb limit takes |F|: what pulls is turned into load.
  const double load = b.normal_force[k] + b.attraction[k];
  b.attraction[k] -= load < 0 ? 2.0 * load : 0.0;
}

CALIB_DEM_CLONES void Damp(double damping, const double* __restrict raised, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    DampLane(damping * raised[k], k, b);
  }
}

CALIB_DEM_CLONES void DampPairs(const double* damping, const double* __restrict raised,
                                ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    DampLane(damping[b.materials[k]] * b.viscous * raised[k], k, b);
  }
}

class SpringsKernel final : public ContactKernel {
 public:
  explicit SpringsKernel(std::vector<Springs> springs) : springs_(std::move(springs)) {}
  void Apply(ContactBlock& block, int /*first*/) const override {
    if (block.mixed) {
      EvaluatePairSprings(springs_.data(), block);
    } else {
      EvaluateSprings(springs_.front(), block);
    }
  }

 private:
  std::vector<Springs> springs_;  ///< per pair of materials
};

class DashpotKernel final : public ContactKernel {
 public:
  DashpotKernel(std::vector<double> damping, const ViscoelasticExponent& exponent)
      : damping_(std::move(damping)), exponent_(exponent) {}
  void Apply(ContactBlock& block, int /*first*/) const override {
    ContactBlock::Lane raised;
    RaiseOverlap(exponent_, block, raised);
    if (block.mixed) {
      DampPairs(damping_.data(), raised, block);
    } else {
      Damp(damping_.front() * block.viscous, raised, block);
    }
  }

 private:
  std::vector<double> damping_;  ///< per pair of materials: gamma [N s/m^(1 + alpha)]
  ViscoelasticExponent exponent_;
};

Springs SpringsAmongEquals(const ParameterSet& law) {
  const double e = law.Get("young_modulus");
  const double nu = law.Get("poisson_ratio");
  return {.normal = 2.0 * e / (3.0 * (1.0 - nu * nu)),
          .tangential = law.Get("tangential_stiffness")};
}

}  // namespace

std::unique_ptr<ContactKernel> MakeViscoelasticSprings(const KernelContext& context) {
  return std::make_unique<SpringsKernel>(
      ForPairs<Springs>(context, &SpringsAmongEquals, [](const Springs& a, const Springs& b) {
        return Springs{.normal = InSeries(a.normal, b.normal),
                       .tangential = InSeries(a.tangential, b.tangential)};
      }));
}

std::unique_ptr<ContactKernel> MakeViscoelasticDashpot(const KernelContext& context,
                                                       const ViscoelasticExponent& exponent) {
  std::vector<double> damping = ForPairs<double>(
      context, [](const ParameterSet& law) { return law.Get("damping"); }, &InSeries);
  if (context.materials != nullptr) {
    context.materials->ApplyPairParameters("damping", damping);
  }
  return std::make_unique<DashpotKernel>(std::move(damping), exponent);
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
