#include "dem/contact/sliding.h"

#include <cmath>

#include "dem/contact/contact_kinematics.h"
#include "dem/contact/simd.h"

namespace calib::dem {
namespace {

CALIB_DEM_CLONES void LimitByCoulomb(ContactBlock& b) {
  const double friction = b.sliding_friction;
  for (int k = 0; k < kBlock; ++k) {
    const double load = b.normal_force[k] + b.attraction[k];
    b.sliding_limit[k] = load > 0 ? friction * load : 0.0;
  }
}

CALIB_DEM_CLONES void LimitPairsByCoulomb(ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    const double load = b.normal_force[k] + b.attraction[k];
    b.sliding_limit[k] = load > 0 ? b.friction[k] * load : 0.0;
  }
}

CALIB_DEM_CLONES void IntegrateShear(ContactBlock& b, int first) {
  double* const sx = b.history[first];
  double* const sy = b.history[first + 1];
  double* const sz = b.history[first + 2];
#pragma GCC ivdep
  for (int k = 0; k < kBlock; ++k) {
    double x = sx[k];
    double y = sy[k];
    double z = sz[k];
    TransportLane(b, k, x, y, z);
    const double ks = b.tangential_stiffness[k];
    x -= ks * b.slip_x[k];
    y -= ks * b.slip_y[k];
    z -= ks * b.slip_z[k];
    const double size = std::sqrt(x * x + y * y + z * z);
    const double limit = b.sliding_limit[k];
    const double cut = size > limit ? limit / size : 1.0;
    sx[k] = b.fx[k] = cut * x;
    sy[k] = b.fy[k] = cut * y;
    sz[k] = b.fz[k] = cut * z;
  }
}

/// At a contact that forms the memory is zero, and nothing is rescaled.
CALIB_DEM_CLONES void RescaleShear(ContactBlock& b, int first) {
  double* const sx = b.history[first];
  double* const sy = b.history[first + 1];
  double* const sz = b.history[first + 2];
  double* const last = b.history[first + 3];
#pragma GCC ivdep
  for (int k = 0; k < kBlock; ++k) {
    const double ks = b.tangential_stiffness[k];
    const double share = ks < last[k] ? ks / last[k] : 1.0;
    last[k] = ks;
    sx[k] *= share;
    sy[k] *= share;
    sz[k] *= share;
  }
}

class CoulombLimit final : public ContactKernel {
 public:
  void Apply(ContactBlock& block, int /*first*/) const override {
    if (block.mixed) {
      LimitPairsByCoulomb(block);
    } else {
      LimitByCoulomb(block);
    }
  }
};

class TangentialSpring final : public ContactKernel {
 public:
  [[nodiscard]] int HistorySize() const override { return 3; }
  void Apply(ContactBlock& block, int first) const override { IntegrateShear(block, first); }
};

class RescaledSpring final : public ContactKernel {
 public:
  [[nodiscard]] int HistorySize() const override { return 4; }
  void Apply(ContactBlock& block, int first) const override {
    RescaleShear(block, first);
    IntegrateShear(block, first);
  }
};

}  // namespace

std::unique_ptr<ContactKernel> MakeCoulombLimit() { return std::make_unique<CoulombLimit>(); }

std::unique_ptr<ContactKernel> MakeTangentialSpring(ShearUnloading unloading) {
  if (unloading == ShearUnloading::kRescaled) {
    return std::make_unique<RescaledSpring>();
  }
  return std::make_unique<TangentialSpring>();
}

}  // namespace calib::dem
