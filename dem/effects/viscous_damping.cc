// `viscous_damping`: dashpots beside the springs of a contact.

#include "dem/effects/viscous_damping.h"

#include <cmath>
#include <vector>

#include "dem/contact/materials.h"
#include "dem/contact/simd.h"
#include "dem/model/effect.h"

namespace calib::dem {
namespace {

CALIB_DEM_INLINE void DampNormalLane(double scale, double mass, int k, ContactBlock& b) {
  const double stiffness = b.normal_stiffness[k] > 0 ? b.normal_stiffness[k] : 0.0;
  const double c = scale * std::sqrt(mass * stiffness);
  const double elastic = b.normal_force[k];
  const double least = elastic < 0 ? elastic : 0.0;
  const double total = elastic - c * b.normal_velocity[k];
  b.normal_force[k] = total > least ? total : least;
  b.normal_damping[k] += c;
}

CALIB_DEM_INLINE void DampShearLane(double scale, double per_time, double mass, int k,
                                    ContactBlock& b) {
  const double c = scale * std::sqrt(mass * b.tangential_stiffness[k]);
  const double limit = b.sliding_limit[k];
  const double spring = std::sqrt(b.fx[k] * b.fx[k] + b.fy[k] * b.fy[k] + b.fz[k] * b.fz[k]);
  // Rounding must not decide: a spring that slides is cut to the limit, up to its last bit.
  const double rate = spring < (1.0 - 1e-9) * limit ? c * per_time : 0.0;
  const double x = b.fx[k] - rate * b.slip_x[k];
  const double y = b.fy[k] - rate * b.slip_y[k];
  const double z = b.fz[k] - rate * b.slip_z[k];
  const double size = std::sqrt(x * x + y * y + z * z);
  const double cut = rate > 0 && size > limit ? limit / size : 1.0;
  b.fx[k] = cut * x;
  b.fy[k] = cut * y;
  b.fz[k] = cut * z;
  b.tangential_damping[k] += c;
}

CALIB_DEM_CLONES void DampNormal(const Dashpot dashpot, ContactBlock& b) {
  const double scale = dashpot.twice_ratio * b.viscous;
  for (int k = 0; k < kBlock; ++k) {
    const double mass = EffectiveMass(dashpot.grains, b.mass_factor, b.radius_i[k], b.radius_j[k]);
    DampNormalLane(scale, mass, k, b);
  }
}

CALIB_DEM_CLONES void DampShear(const Dashpot dashpot, ContactBlock& b) {
  const double scale = dashpot.twice_ratio * b.viscous;
  const double per_time = b.dt > 0 ? 1.0 / b.dt : 0.0;
  for (int k = 0; k < kBlock; ++k) {
    const double mass = EffectiveMass(dashpot.grains, b.mass_factor, b.radius_i[k], b.radius_j[k]);
    DampShearLane(scale, per_time, mass, k, b);
  }
}

CALIB_DEM_CLONES void DampPairsNormal(const double* twice_ratio, ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    DampNormalLane(twice_ratio[b.materials[k]] * b.viscous, b.effective_mass[k], k, b);
  }
}

CALIB_DEM_CLONES void DampPairsShear(const double* twice_ratio, ContactBlock& b) {
  const double per_time = b.dt > 0 ? 1.0 / b.dt : 0.0;
  for (int k = 0; k < kBlock; ++k) {
    DampShearLane(twice_ratio[b.materials[k]] * b.viscous, per_time, b.effective_mass[k], k, b);
  }
}

/// 2 beta per pair of materials.
std::vector<double> TwiceRatios(const KernelContext& context) {
  std::vector<double> ratios = PairValues(context, "ratio");
  for (double& ratio : ratios) {
    ratio *= 2.0;
  }
  return ratios;
}

class NormalDashpot final : public ContactKernel {
 public:
  explicit NormalDashpot(const KernelContext& context)
      : dashpot_(DashpotFrom(context)), twice_ratio_(TwiceRatios(context)) {}
  void Apply(ContactBlock& block, int /*first*/) const override {
    if (block.mixed) {
      DampPairsNormal(twice_ratio_.data(), block);
    } else {
      DampNormal(dashpot_, block);
    }
  }

 private:
  Dashpot dashpot_;
  std::vector<double> twice_ratio_;  ///< per pair of materials
};

class ShearDashpot final : public ContactKernel {
 public:
  explicit ShearDashpot(const KernelContext& context)
      : dashpot_(DashpotFrom(context)), twice_ratio_(TwiceRatios(context)) {}
  void Apply(ContactBlock& block, int /*first*/) const override {
    if (block.mixed) {
      DampPairsShear(twice_ratio_.data(), block);
    } else {
      DampShear(dashpot_, block);
    }
  }

 private:
  Dashpot dashpot_;
  std::vector<double> twice_ratio_;  ///< per pair of materials
};

std::unique_ptr<ContactKernel> MakeNormal(const KernelContext& context) {
  return std::make_unique<NormalDashpot>(context);
}

std::unique_ptr<ContactKernel> MakeShear(const KernelContext& context) {
  return std::make_unique<ShearDashpot>(context);
}

}  // namespace

Dashpot DashpotFrom(const KernelContext& context) {
  return {.twice_ratio = 2.0 * context.parameters.Get("ratio"),
          .grains = GrainMassOf(context.density, context.thickness)};
}

///   c = 2 beta sqrt(m* k),   m* = m1 m2/(m1 + m2),   k the tangent stiffness
///   normal: F = F_b + c du/dt, but a repulsive contact never pulls (F >= min(F_b, 0))
///   shear:  Fs = spring - c_s ds/dt with k = ks, only while the spring sticks (below the sliding
///           limit), and never beyond the limit
/// beta is the damping ratio of two grains on a linear spring, 1 critical. With linear contacts
/// their restitution is exp(-beta/sqrt(1-beta^2) (pi - arctan(2 beta sqrt(1-beta^2)/(2 beta^2-1))))
/// [Schwager & Poeschel 2007, Eq. 14]; with Hertz contacts it does not depend on speed either
/// [Tsuji, Tanaka & Ishida 1992]. Masses are those of the grains, spheres or disks. Off during
/// consolidation; in staged quasi-static tests little is left of it, since a settled state has no
/// velocities. One-sided, vanishes at beta = 0. The time step follows the dashpots.
EffectEntry ViscousDamping() {
  ParameterInfo ratio;
  ratio.name = "ratio";
  ratio.unit = "1";
  ratio.max = 10;
  ratio.default_prior = {.kind = "log_uniform", .min = 0.01, .max = 10};
  ratio.null_value = 0;
  ratio.of_pairs = true;
  ratio.description = "damping ratio beta of both dashpots; 1 is critical for two equal grains";
  return {.info = {.name = "viscous_damping",
                   .kind = "contact",
                   .description =
                       "Dashpots c = 2 beta sqrt(m* k) beside the normal and, while it sticks, the "
                       "shear spring; no tension; off during consolidation; one-sided, vanishes at "
                       "ratio 0; shows in tests with a loading_rate",
                   .contacts = {},
                   .parameters = {ratio},
                   .reference = "Tsuji, Tanaka & Ishida, Powder Technol. 71 (1992) 239; Schwager & "
                                "Poeschel, Granular Matter 9 (2007) 465",
                   .two_sided = false,
                   .rays = {{.parameter = "ratio", .steps = {0.3, 2}}},
                   .needs_motion = true},
          .place = 90,
          .kernels = {{.stage = ContactStage::kNormalExtra, .make = &MakeNormal},
                      {.stage = ContactStage::kShearExtra, .make = &MakeShear}}};
}

}  // namespace calib::dem
