#include "dem/dynamics/common_chain.h"

#include <algorithm>
#include <cmath>

#include "dem/contact/quad.h"
#include "dem/contact/simd.h"
#include "dem/model/contact_law.h"

namespace calib::dem {
namespace {

/// Normal force, tangential and normal stiffness; the formulas of hertz_mindlin.cc and linear.cc.
struct Response {
  double fn, ks, kn;
};

struct HertzLaw {
  static constexpr bool kLimitBySmaller = false;
  static CALIB_DEM_INLINE Response At(double normal, double tangential, double radius, double u) {
    const double contact_radius = std::sqrt(radius * u);
    const double kn = normal * contact_radius;
    return {kn * u, tangential * contact_radius, 1.5 * kn};
  }
};

struct LinearLaw {
  static constexpr bool kLimitBySmaller = true;
  static CALIB_DEM_INLINE Response At(double normal, double tangential, double radius, double u) {
    const double kn = normal * radius;
    return {kn * u, tangential * kn, kn};
  }
};

/// How the tangent plane has turned since the last step: see TransportLane().
struct Turn {
  double nx, ny, nz;
  double mean_x, mean_y, mean_z;  ///< n - dn/2
  double spin;
};

struct Tangent {
  double x, y, z;
};

/// A force or moment in the tangent plane, and its length before it was cut at the limit.
struct Spring : Tangent {
  double uncut;
};

/// A spring in the tangent plane: carried along, stretched by -stiffness step, cut at its limit.
CALIB_DEM_INLINE Spring Stretched(const Turn& t, const Tangent& s, double stiffness,
                                  const Tangent& step, double limit) {
  const double along = t.nx * s.x + t.ny * s.y + t.nz * s.z;
  const double px = s.x - along * t.mean_x;
  const double py = s.y - along * t.mean_y;
  const double pz = s.z - along * t.mean_z;
  const double keep = 1.0 - 0.5 * t.spin * t.spin;
  const double x = keep * px + t.spin * (t.ny * pz - t.nz * py) - stiffness * step.x;
  const double y = keep * py + t.spin * (t.nz * px - t.nx * pz) - stiffness * step.y;
  const double z = keep * pz + t.spin * (t.nx * py - t.ny * px) - stiffness * step.z;
  const double size = std::sqrt(x * x + y * y + z * z);
  const double cut = size > limit ? limit / size : 1.0;
  return {{cut * x, cut * y, cut * z}, size};
}

/// Force less what a dashpot of its own stiffness takes, without tension: see viscous_damping.cc.
CALIB_DEM_INLINE double Damped(double scale, double mass, const Response& response,
                               double velocity) {
  const double c = scale * std::sqrt(mass * (response.kn > 0 ? response.kn : 0.0));
  const double least = response.fn < 0 ? response.fn : 0.0;
  const double total = response.fn - c * velocity;
  return total > least ? total : least;
}

/// A shear spring and, while it sticks, the dashpot beside it: see viscous_damping.cc. A spring
/// that was cut is as long as the limit.
CALIB_DEM_INLINE Tangent WithDashpot(double c_per_time, const Spring& s, const Tangent& step,
                                     double limit) {
  const double rate = s.uncut < (1.0 - 1e-9) * limit ? c_per_time : 0.0;
  const double x = s.x - rate * step.x;
  const double y = s.y - rate * step.y;
  const double z = s.z - rate * step.z;
  const double size = std::sqrt(x * x + y * y + z * z);
  const double cut = rate > 0 && size > limit ? limit / size : 1.0;
  return {cut * x, cut * y, cut * z};
}

struct MomentPair {
  double stiffness, limit;
};

/// See EvaluateMoment().
template <class Law>
CALIB_DEM_INLINE MomentPair MomentAt(const MomentLaw& law, double ri, double rj,
                                     const Response& response) {
  const double length = Law::kLimitBySmaller ? (ri < rj ? ri : rj) : 0.5 * (ri + rj);
  return {law.constant + law.ratio * (ri * rj * response.ks),
          law.friction * ((response.fn > 0 ? response.fn : 0.0) * length)};
}

/// Formulas, in this order of operations, of ComputeKinematics, the laws, LimitByCoulomb,
/// IntegrateShear, DampNormal, DampShear, IntegrateRolling, IntegrateTwisting, ComputeTotals.
template <class Law, int kMoments, bool kDamped>
CALIB_DEM_INLINE void Pass(const CommonChain& chain, ContactBlock& b) {
  const double normal = chain.normal;
  const double tangential = chain.tangential;
  const MomentLaw rolling = kMoments > 0 ? *chain.rolling : MomentLaw{};
  const MomentLaw twisting = kMoments > 1 ? *chain.twisting : MomentLaw{};
  const Dashpot dashpot = kDamped ? *chain.dashpot : Dashpot{};
  const double damping = dashpot.twice_ratio * b.viscous;
  const double mass_factor = b.mass_factor;
  const double dt = b.dt;
  const double per_time = dt > 0 ? 1.0 / dt : 0.0;
  const double lx = b.stretch[0];
  const double ly = b.stretch[1];
  const double lz = b.stretch[2];
  const double shear = b.shear;
  const double friction = b.sliding_friction;
  ContactBlock::Lane* const memory = b.history;
#pragma GCC ivdep
  for (int k = 0; k < kBlock; ++k) {
    const double ri = b.radius_i[k];
    const double rj = b.radius_j[k];
    const double sum = ri + rj;
    const double dx = b.dx[k];
    const double dy = b.dy[k];
    const double dz = b.dz[k];
    const double distance = std::sqrt(dx * dx + dy * dy + dz * dz);
    const double both = 1.0 / (distance * sum);
    const double inverse = both * sum;
    const double nx = dx * inverse;
    const double ny = dy * inverse;
    const double nz = dz * inverse;
    const double overlap = sum - distance;
    const bool on = overlap > 0;
    b.overlap[k] = overlap;

    const double vx = b.vx[k] + lx * dx + shear * dz;
    const double vy = b.vy[k] + ly * dy;
    const double vz = b.vz[k] + lz * dz;
    const double vn = nx * vx + ny * vy + nz * vz;
    const double tx = vx - nx * vn;
    const double ty = vy - ny * vn;
    const double tz = vz - nz * vn;
    const double half_turn = 0.5 * dt * inverse;
    const double wix = b.wix[k];
    const double wiy = b.wiy[k];
    const double wiz = b.wiz[k];
    const double wjx = b.wjx[k];
    const double wjy = b.wjy[k];
    const double wjz = b.wjz[k];
    const double cx = ri * wix + rj * wjx;
    const double cy = ri * wiy + rj * wjy;
    const double cz = ri * wiz + rj * wjz;
    const double rigid = sum * inverse;
    const Tangent slip = {dt * (rigid * tx - (cy * nz - cz * ny)),
                          dt * (rigid * ty - (cz * nx - cx * nz)),
                          dt * (rigid * tz - (cx * ny - cy * nx))};
    const double rx = dt * (wjx - wix);
    const double ry = dt * (wjy - wiy);
    const double rz = dt * (wjz - wiz);
    const double twist = nx * rx + ny * ry + nz * rz;
    const Turn turn = {nx,
                       ny,
                       nz,
                       nx - half_turn * tx,
                       ny - half_turn * ty,
                       nz - half_turn * tz,
                       0.5 * dt * (nx * (wix + wjx) + ny * (wiy + wjy) + nz * (wiz + wjz))};

    Response response =
        Law::At(normal, tangential, ri * rj * (both * distance), on ? overlap : 0.0);
    const double mass = kDamped ? EffectiveMass(dashpot.grains, mass_factor, ri, rj) : 0.0;
    if constexpr (kDamped) {
      response.fn = Damped(damping, mass, response, vn);
    }
    const double limit = response.fn > 0 ? friction * response.fn : 0.0;
    const Spring spring =
        Stretched(turn, {memory[0][k], memory[1][k], memory[2][k]}, response.ks, slip, limit);
    memory[0][k] = on ? spring.x : 0.0;
    memory[1][k] = on ? spring.y : 0.0;
    memory[2][k] = on ? spring.z : 0.0;
    Tangent fs{spring.x, spring.y, spring.z};
    if constexpr (kDamped) {
      const double c = damping * std::sqrt(mass * response.ks);
      fs = WithDashpot(c * per_time, spring, slip, limit);
    }

    double mx = 0;
    double my = 0;
    double mz = 0;
    if constexpr (kMoments > 0) {
      const MomentPair law = MomentAt<Law>(rolling, ri, rj, response);
      const Spring m = Stretched(turn, {memory[3][k], memory[4][k], memory[5][k]}, law.stiffness,
                                 {rx - nx * twist, ry - ny * twist, rz - nz * twist}, law.limit);
      memory[3][k] = on ? m.x : 0.0;
      memory[4][k] = on ? m.y : 0.0;
      memory[5][k] = on ? m.z : 0.0;
      mx += m.x;
      my += m.y;
      mz += m.z;
    }
    if constexpr (kMoments > 1) {
      const MomentPair law = MomentAt<Law>(twisting, ri, rj, response);
      const double trial = memory[6][k] - law.stiffness * twist;
      const double upper = trial < law.limit ? trial : law.limit;
      const double moment = upper > -law.limit ? upper : -law.limit;
      memory[6][k] = on ? moment : 0.0;
      mx += moment * nx;
      my += moment * ny;
      mz += moment * nz;
    }

    const double qx = ny * fs.z - nz * fs.y;
    const double qy = nz * fs.x - nx * fs.z;
    const double qz = nx * fs.y - ny * fs.x;
    const double arm_i = ri - 0.5 * overlap;
    const double arm_j = rj - 0.5 * overlap;
    b.force_x[k] = on ? response.fn * nx + fs.x : 0.0;
    b.force_y[k] = on ? response.fn * ny + fs.y : 0.0;
    b.force_z[k] = on ? response.fn * nz + fs.z : 0.0;
    b.torque_ix[k] = on ? -arm_i * qx - mx : 0.0;
    b.torque_iy[k] = on ? -arm_i * qy - my : 0.0;
    b.torque_iz[k] = on ? -arm_i * qz - mz : 0.0;
    b.torque_jx[k] = on ? mx - arm_j * qx : 0.0;
    b.torque_jy[k] = on ? my - arm_j * qy : 0.0;
    b.torque_jz[k] = on ? mz - arm_j * qz : 0.0;
  }
}

CALIB_DEM_CLONES void Hertz(const CommonChain& c, ContactBlock& b) {
  Pass<HertzLaw, 0, false>(c, b);
}
CALIB_DEM_CLONES void HertzDamped(const CommonChain& c, ContactBlock& b) {
  Pass<HertzLaw, 0, true>(c, b);
}
CALIB_DEM_CLONES void HertzRolling(const CommonChain& c, ContactBlock& b) {
  Pass<HertzLaw, 1, false>(c, b);
}
CALIB_DEM_CLONES void HertzRollingDamped(const CommonChain& c, ContactBlock& b) {
  Pass<HertzLaw, 1, true>(c, b);
}
CALIB_DEM_CLONES void HertzMoments(const CommonChain& c, ContactBlock& b) {
  Pass<HertzLaw, 2, false>(c, b);
}
CALIB_DEM_CLONES void HertzMomentsDamped(const CommonChain& c, ContactBlock& b) {
  Pass<HertzLaw, 2, true>(c, b);
}
CALIB_DEM_CLONES void Linear(const CommonChain& c, ContactBlock& b) {
  Pass<LinearLaw, 0, false>(c, b);
}
CALIB_DEM_CLONES void LinearDamped(const CommonChain& c, ContactBlock& b) {
  Pass<LinearLaw, 0, true>(c, b);
}
CALIB_DEM_CLONES void LinearRolling(const CommonChain& c, ContactBlock& b) {
  Pass<LinearLaw, 1, false>(c, b);
}
CALIB_DEM_CLONES void LinearRollingDamped(const CommonChain& c, ContactBlock& b) {
  Pass<LinearLaw, 1, true>(c, b);
}
CALIB_DEM_CLONES void LinearMoments(const CommonChain& c, ContactBlock& b) {
  Pass<LinearLaw, 2, false>(c, b);
}
CALIB_DEM_CLONES void LinearMomentsDamped(const CommonChain& c, ContactBlock& b) {
  Pass<LinearLaw, 2, true>(c, b);
}

/// The share of ComputeKinematics, the laws, DampNormal, DampShear and EvaluateMoment.
template <class Law, bool kDamped>
CALIB_DEM_INLINE void StiffnessPass(const CommonChain& chain, ContactBlock& b) {
  const double normal = chain.normal;
  const double tangential = chain.tangential;
  const MomentLaw rolling = chain.rolling.value_or(MomentLaw{});
  const MomentLaw twisting = chain.twisting.value_or(MomentLaw{});
  const Dashpot dashpot = kDamped ? *chain.dashpot : Dashpot{};
  const double damping = dashpot.twice_ratio * b.viscous;
  const double mass_factor = b.mass_factor;
#pragma GCC ivdep
  for (int k = 0; k < kBlock; ++k) {
    const double ri = b.radius_i[k];
    const double rj = b.radius_j[k];
    const double sum = ri + rj;
    const double dx = b.dx[k];
    const double dy = b.dy[k];
    const double dz = b.dz[k];
    const double distance = std::sqrt(dx * dx + dy * dy + dz * dz);
    const double both = 1.0 / (distance * sum);
    const double inverse = both * sum;
    const double overlap = sum - distance;
    b.nx[k] = dx * inverse;
    b.ny[k] = dy * inverse;
    b.nz[k] = dz * inverse;
    b.overlap[k] = overlap;
    const Response response =
        Law::At(normal, tangential, ri * rj * (both * distance), overlap > 0 ? overlap : 0.0);
    b.normal_stiffness[k] = response.kn;
    b.tangential_stiffness[k] = response.ks;
    const double arms = ri * rj * response.ks;
    b.rolling_stiffness[k] = rolling.constant + rolling.ratio * arms;
    b.twisting_stiffness[k] = twisting.constant + twisting.ratio * arms;
    const double mass = kDamped ? EffectiveMass(dashpot.grains, mass_factor, ri, rj) : 0.0;
    const double pressed = response.kn > 0 ? response.kn : 0.0;
    b.normal_damping[k] = kDamped ? damping * std::sqrt(mass * pressed) : 0.0;
    b.tangential_damping[k] = kDamped ? damping * std::sqrt(mass * response.ks) : 0.0;
  }
}

CALIB_DEM_CLONES void HertzStiffness(const CommonChain& c, ContactBlock& b) {
  StiffnessPass<HertzLaw, false>(c, b);
}
CALIB_DEM_CLONES void HertzStiffnessDamped(const CommonChain& c, ContactBlock& b) {
  StiffnessPass<HertzLaw, true>(c, b);
}
CALIB_DEM_CLONES void LinearStiffness(const CommonChain& c, ContactBlock& b) {
  StiffnessPass<LinearLaw, false>(c, b);
}
CALIB_DEM_CLONES void LinearStiffnessDamped(const CommonChain& c, ContactBlock& b) {
  StiffnessPass<LinearLaw, true>(c, b);
}

CALIB_DEM_CLONES int Touching(const double* overlap, std::uint8_t* touching) {
  int count = 0;
  for (int k = 0; k < kBlock; ++k) {
    const int on = overlap[k] > 0 ? 1 : 0;
    touching[k] = static_cast<std::uint8_t>(on);
    count += on;
  }
  return count;
}

int MomentsOf(const CommonChain& chain) { return chain.twisting ? 2 : (chain.rolling ? 1 : 0); }

/// Lanes that are not in use repeat the first one.
void ClearUnused(int moments, ContactBlock& b) {
  for (ContactBlock::Lane* lane :
       {&b.overlap, &b.force_x, &b.force_y, &b.force_z, &b.torque_ix, &b.torque_iy, &b.torque_iz,
        &b.torque_jx, &b.torque_jy, &b.torque_jz}) {
    std::fill(*lane + b.count, *lane + kBlock, 0.0);
  }
  constexpr int kColumns[] = {3, 6, 7};
  for (int c = 0; c < kColumns[moments]; ++c) {
    std::fill(b.history[c] + b.count, b.history[c] + kBlock, 0.0);
  }
}

}  // namespace

std::optional<CommonChain> CommonChainOf(const Model& model, const ModelEntries& entries,
                                         double thickness) {
  CommonChain chain;
  chain.hertz = model.contact == "hertz_mindlin";
  if ((!chain.hertz && model.contact != "linear") || !model.materials.empty() ||
      model.shear_unloading != ShearUnloading::kAsPublished) {
    return std::nullopt;
  }
  const ParameterSet parameters =
      ResolveParameters(entries.law->info.parameters, "", model.parameters);
  const double e = parameters.Get("young_modulus");
  const double nu = parameters.Get("poisson_ratio");
  chain.normal = chain.hertz ? 2.0 * e / (3.0 * (1.0 - nu * nu)) : 2.0 * e;
  chain.tangential = chain.hertz ? 2.0 * e / ((1.0 + nu) * (2.0 - nu)) : nu;
  for (const EffectEntry* effect : entries.effects) {
    const std::string& name = effect->info.name;
    if (effect->kernels.empty()) {
      continue;
    }
    const KernelContext context{
        .linear_springs = entries.law->info.linear_springs,
        .effect = name,
        .density = model.density,
        .thickness = thickness,
        .law = parameters,
        .parameters = ResolveParameters(effect->info.parameters, name + ".", model.parameters)};
    if (name == "viscous_damping") {
      chain.dashpot = DashpotFrom(context);
      continue;
    }
    const bool rolls = name == "rolling_resistance" && !chain.twisting;
    if (!rolls && !(name == "twisting_resistance" && chain.rolling)) {
      return std::nullopt;
    }
    (rolls ? chain.rolling : chain.twisting) = MomentLawFrom(context);
  }
  for (const UserEffect& effect : model.user_effects) {
    if (effect.info.kind == "contact" && std::find(model.effects.begin(), model.effects.end(),
                                                   effect.info.name) != model.effects.end()) {
      return std::nullopt;
    }
  }
  return chain;
}

int EvaluateCommonChain(const CommonChain& chain, ContactBlock& b, std::uint8_t* touching) {
  constexpr void (*kPasses[2][3][2])(const CommonChain&, ContactBlock&) = {
      {{&Linear, &LinearDamped},
       {&LinearRolling, &LinearRollingDamped},
       {&LinearMoments, &LinearMomentsDamped}},
      {{&Hertz, &HertzDamped},
       {&HertzRolling, &HertzRollingDamped},
       {&HertzMoments, &HertzMomentsDamped}}};
  const int moments = MomentsOf(chain);
  kPasses[chain.hertz ? 1 : 0][moments][chain.dashpot ? 1 : 0](chain, b);
  if (b.count < kBlock) {
    ClearUnused(moments, b);
  }
  return Touching(b.overlap, touching);
}

void CommonChainStiffness(const CommonChain& chain, ContactBlock& b) {
  constexpr void (*kPasses[2][2])(const CommonChain&, ContactBlock&) = {
      {&LinearStiffness, &LinearStiffnessDamped}, {&HertzStiffness, &HertzStiffnessDamped}};
  kPasses[chain.hertz ? 1 : 0][chain.dashpot ? 1 : 0](chain, b);
}

}  // namespace calib::dem
