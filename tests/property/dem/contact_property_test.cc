// Any contact under any law, with and without effects: what it does does not depend on who looks
// from where, and what one grain loses the other gains.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <array>
#include <cmath>

#include "dem/dynamics/contact_model.h"
#include "dem/registry/registry.h"

namespace calib::dem {
namespace {

using Vector = std::array<double, 3>;
using Matrix = std::array<Vector, 3>;

rc::Gen<double> Real(double low, double high) {
  return rc::gen::map(
      rc::gen::inRange<std::int64_t>(0, std::int64_t{1} << 40),
      [=](std::int64_t k) { return low + (high - low) * static_cast<double>(k) * 0x1p-40; });
}

Vector SomeVector(double size) {
  return {*Real(-size, size), *Real(-size, size), *Real(-size, size)};
}

Vector Times(const Matrix& m, const Vector& v) {
  Vector r{};
  for (std::size_t a = 0; a < 3; ++a) {
    r[a] = m[a][0] * v[0] + m[a][1] * v[1] + m[a][2] * v[2];
  }
  return r;
}

Matrix SomeRotation() {
  double q[4] = {*Real(-1, 1), *Real(-1, 1), *Real(-1, 1), *Real(0.1, 1)};
  const double size = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (double& c : q) c /= size;
  const auto [x, y, z, w] = q;
  return {{{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
           {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
           {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}}};
}

Model SomeModel() {
  Model model;
  model.density = 2650;
  model.parameters = {{"young_modulus", *Real(1e8, 1e10)}, {"friction_coefficient", *Real(0, 1)}};
  switch (*rc::gen::inRange(0, 4)) {
    case 0:
      model.contact = "hertz_mindlin";
      break;
    case 1:
      model.contact = "linear";
      break;
    case 2:
      model.contact = "tsuji";
      break;
    default:
      model.contact = "extended_viscoelastic";
      model.parameters["damping_exponent"] = *Real(0, 1.5);
  }
  if (model.contact == "tsuji" || model.contact == "extended_viscoelastic") {
    model.parameters["damping"] = *Real(0, 1e4);
    model.parameters["tangential_stiffness"] = *Real(0, 1e6);
  }
  if (*rc::gen::arbitrary<bool>()) {
    for (const std::string effect : {"rolling_resistance", "twisting_resistance"}) {
      model.effects.push_back(effect);
      model.parameters[effect + ".stiffness_ratio"] = *Real(0, 1);
      model.parameters[effect + ".friction"] = *Real(0, 1);
    }
  }
  if (*rc::gen::arbitrary<bool>()) {
    model.effects.emplace_back("viscous_damping");
    model.parameters["viscous_damping.ratio"] = *Real(0, 1);
  }
  return model;
}

/// A pair that moves through a few steps, its motion in a frame turned by `frame`.
struct Motion {
  double ri = 0, rj = 0, overlap = 0;
  Vector normal{};
  std::array<Vector, 3> velocity{}, spin_i{}, spin_j{};
};

struct Loads {
  Vector force, torque_i, torque_j, branch;
};

Motion SomeMotion() {
  Motion m{.ri = *Real(0.5e-3, 2e-3), .rj = *Real(0.5e-3, 2e-3)};
  m.overlap = *Real(1e-6, 1e-5);  // three steps take away less than 6e-7
  m.normal = SomeVector(1);
  m.normal[0] += 1.5;
  for (std::size_t s = 0; s < 3; ++s) {
    m.velocity[s] = SomeVector(0.1);
    m.spin_i[s] = SomeVector(50);
    m.spin_j[s] = SomeVector(50);
  }
  return m;
}

Loads Follow(const Model& model, const Motion& motion, const Matrix& frame) {
  constexpr double kDt = 1e-6;
  const ContactModel contact = ContactModelOf(model);
  ContactBlock b{};
  b.sliding_friction = contact.sliding_friction();
  b.dt = kDt;
  const double size =
      std::sqrt(motion.normal[0] * motion.normal[0] + motion.normal[1] * motion.normal[1] +
                motion.normal[2] * motion.normal[2]);
  Vector d{};
  for (std::size_t a = 0; a < 3; ++a) {
    d[a] = motion.normal[a] / size * (motion.ri + motion.rj - motion.overlap);
  }
  for (std::size_t s = 0; s < 3; ++s) {
    for (std::size_t a = 0; a < 3; ++a) d[a] += kDt * motion.velocity[s][a];
    const Vector x = Times(frame, d);
    const Vector v = Times(frame, motion.velocity[s]);
    const Vector wi = Times(frame, motion.spin_i[s]);
    const Vector wj = Times(frame, motion.spin_j[s]);
    for (int k = 0; k < kBlock; ++k) {
      b.radius_i[k] = motion.ri;
      b.radius_j[k] = motion.rj;
      b.dx[k] = x[0];
      b.dy[k] = x[1];
      b.dz[k] = x[2];
      b.vx[k] = v[0];
      b.vy[k] = v[1];
      b.vz[k] = v[2];
      b.wix[k] = wi[0];
      b.wiy[k] = wi[1];
      b.wiz[k] = wi[2];
      b.wjx[k] = wj[0];
      b.wjy[k] = wj[1];
      b.wjz[k] = wj[2];
    }
    contact.Evaluate(b);
  }
  return {.force = {b.force_x[0], b.force_y[0], b.force_z[0]},
          .torque_i = {b.torque_ix[0], b.torque_iy[0], b.torque_iz[0]},
          .torque_j = {b.torque_jx[0], b.torque_jy[0], b.torque_jz[0]},
          .branch = Times(frame, d)};
}

double Size(const Vector& v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

bool Near(const Vector& a, const Vector& b, double tolerance) {
  return Size({a[0] - b[0], a[1] - b[1], a[2] - b[2]}) <= tolerance;
}

constexpr Matrix kSame = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

RC_GTEST_PROP(Contact, LoadsTurnWithTheFrame, ()) {
  const Model model = SomeModel();
  const Motion motion = SomeMotion();
  const Matrix frame = SomeRotation();
  RC_LOG() << model.contact << " with " << model.effects.size() << " effects" << std::endl;
  const Loads here = Follow(model, motion, kSame);
  const Loads there = Follow(model, motion, frame);
  // Rounding of the branch (1e-16 of 1e-3 m) stands against an overlap of 4e-7 m and more.
  const double force = 1e-7 * Size(here.force);
  RC_ASSERT(Near(Times(frame, here.force), there.force, force));
  RC_ASSERT(Near(Times(frame, here.torque_i), there.torque_i, 4e-3 * force));
  RC_ASSERT(Near(Times(frame, here.torque_j), there.torque_j, 4e-3 * force));
}

// Forces are opposite by construction (one is stored, the other its negative); their couple must
// be balanced by the torques: Ti + Tj + d x F = 0 about the centre of i.
RC_GTEST_PROP(Contact, AngularMomentumIsExchanged, ()) {
  const Loads loads = Follow(SomeModel(), SomeMotion(), kSame);
  const Vector& d = loads.branch;
  const Vector& f = loads.force;
  const Vector couple = {d[1] * f[2] - d[2] * f[1], d[2] * f[0] - d[0] * f[2],
                         d[0] * f[1] - d[1] * f[0]};
  Vector sum{};
  for (std::size_t a = 0; a < 3; ++a) {
    sum[a] = loads.torque_i[a] + loads.torque_j[a] + couple[a];
  }
  RC_ASSERT(Size(sum) <= 1e-11 * Size(f) * Size(d));
}

// Grains exchanged: the same contact seen from the other side.
RC_GTEST_PROP(Contact, EitherGrainMayBeTheFirst, ()) {
  const Model model = SomeModel();
  const Motion motion = SomeMotion();
  Motion other{.ri = motion.rj, .rj = motion.ri, .overlap = motion.overlap};
  for (std::size_t a = 0; a < 3; ++a) {
    other.normal[a] = -motion.normal[a];
    for (std::size_t s = 0; s < 3; ++s) other.velocity[s][a] = -motion.velocity[s][a];
  }
  other.spin_i = motion.spin_j;
  other.spin_j = motion.spin_i;
  const Loads a = Follow(model, motion, kSame);
  const Loads b = Follow(model, other, kSame);
  const double force = 1e-9 * Size(a.force);
  RC_ASSERT(Near(a.force, {-b.force[0], -b.force[1], -b.force[2]}, force));
  RC_ASSERT(Near(a.torque_i, b.torque_j, 4e-3 * force));
  RC_ASSERT(Near(a.torque_j, b.torque_i, 4e-3 * force));
}

}  // namespace
}  // namespace calib::dem
