#include "dem/dynamics/rigid_clumps.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "dem/dynamics/chunks.h"
#include "dem/particles/union_of_spheres.h"

namespace calib::dem {
namespace {

using Vector = std::array<double, 3>;
using Quaternion = std::array<double, 4>;

constexpr int kClumpChunk = 64;

Vector Cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// Principal to cell axes.
Vector Turn(const Quaternion& q, const Vector& v) {
  const Vector u = {q[1], q[2], q[3]};
  const Vector t = Cross(u, v);
  const Vector twice = {2 * t[0], 2 * t[1], 2 * t[2]};
  const Vector more = Cross(u, twice);
  return {v[0] + q[0] * twice[0] + more[0], v[1] + q[0] * twice[1] + more[1],
          v[2] + q[0] * twice[2] + more[2]};
}

Vector TurnBack(const Quaternion& q, const Vector& v) {
  return Turn({q[0], -q[1], -q[2], -q[3]}, v);
}

/// q after a rotation by the angular velocity w during dt: (1, w dt/2) q, normalised; the angle is
/// 2 arctan(w dt/2), right to third order.
Quaternion Rotate(const Quaternion& q, const Vector& w, double dt) {
  const double x = 0.5 * dt * w[0];
  const double y = 0.5 * dt * w[1];
  const double z = 0.5 * dt * w[2];
  Quaternion r = {q[0] - x * q[1] - y * q[2] - z * q[3], q[1] + x * q[0] + y * q[3] - z * q[2],
                  q[2] + y * q[0] + z * q[1] - x * q[3], q[3] + z * q[0] + x * q[2] - y * q[1]};
  const double scale = 1.0 / std::sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + r[3] * r[3]);
  for (double& c : r) {
    c *= scale;
  }
  return r;
}

/// Angular velocity of a body of this momentum, cell axes.
Vector Spin(const Clump& c, const Quaternion& q, const Vector& momentum) {
  Vector local = TurnBack(q, momentum);
  for (std::size_t a = 0; a < 3; ++a) {
    local[a] /= c.inertia[a];
  }
  return Turn(q, local);
}

/// Quaternion of the rotation whose matrix has the axes as columns.
Quaternion FromAxes(const std::array<Vector, 3>& axes) {
  const auto m = [&axes](std::size_t row, std::size_t column) { return axes[column][row]; };
  Quaternion q{};
  const double w2 = 1 + m(0, 0) + m(1, 1) + m(2, 2);
  const double x2 = 1 + m(0, 0) - m(1, 1) - m(2, 2);
  const double y2 = 1 - m(0, 0) + m(1, 1) - m(2, 2);
  const double z2 = 1 - m(0, 0) - m(1, 1) + m(2, 2);
  const double largest = std::max({w2, x2, y2, z2});
  if (largest == w2) {
    q = {w2, m(2, 1) - m(1, 2), m(0, 2) - m(2, 0), m(1, 0) - m(0, 1)};
  } else if (largest == x2) {
    q = {m(2, 1) - m(1, 2), x2, m(0, 1) + m(1, 0), m(0, 2) + m(2, 0)};
  } else if (largest == y2) {
    q = {m(0, 2) - m(2, 0), m(0, 1) + m(1, 0), y2, m(1, 2) + m(2, 1)};
  } else {
    q = {m(1, 0) - m(0, 1), m(0, 2) + m(2, 0), m(1, 2) + m(2, 1), z2};
  }
  return Rotate(q, {0, 0, 0}, 0);  // normalised
}

Clump MakeClump(const std::vector<int>& members, const Packing& packing, double density,
                ParticleArrays& p) {
  Clump c;
  c.members = members;
  std::vector<Sphere> spheres;
  const auto first = static_cast<std::size_t>(members.front());
  const Vector base = {p.x[first], p.y[first], p.z[first]};
  for (const int m : members) {
    const auto k = static_cast<std::size_t>(m);
    Vector centre = {p.x[k], p.y[k], p.z[k]};
    for (std::size_t a = 0; a < 3; ++a) {
      const double turns = std::round((centre[a] - base[a]) / packing.length[a]);
      centre[a] -= turns * packing.length[a];
    }
    spheres.push_back({.centre = centre, .radius = p.radius[k]});
  }
  const SolidMoments moments = MomentsOfUnion(spheres);
  const PrincipalMoments principal = Diagonalize(moments.inertia);
  c.volume = moments.volume;
  c.mass = density * moments.volume;
  c.centre = moments.centroid;
  c.orientation = FromAxes(principal.axes);
  for (std::size_t a = 0; a < 3; ++a) {
    c.inertia[a] = density * principal.moment[a];
  }
  for (std::size_t s = 0; s < spheres.size(); ++s) {
    Vector arm{};
    for (std::size_t a = 0; a < 3; ++a) {
      arm[a] = spheres[s].centre[a] - c.centre[a];
    }
    c.arm.push_back(arm);
    c.at.push_back(TurnBack(c.orientation, arm));
    const auto k = static_cast<std::size_t>(members[s]);
    p.inverse_mass[k] = 1.0 / c.mass;
    p.inverse_inertia[k] = 1.0 / c.inertia[0];
  }
  c.image.resize(members.size());
  return c;
}

/// Leapfrog kick of one component with local damping, as for spheres (leapfrog.h).
double Damped(double load, double velocity, double damping) {
  return load * (load * velocity > 0 ? 1.0 - damping : 1.0 + damping);
}

void AdvanceOne(const Motion& motion, const PeriodicCell& cell, Clump& c, ParticleArrays& p) {
  Vector force{};
  Vector torque{};
  for (std::size_t s = 0; s < c.members.size(); ++s) {
    const auto m = static_cast<std::size_t>(c.members[s]);
    const Vector f = {p.fx[m], p.fy[m], p.fz[m]};
    const Vector couple = Cross(c.arm[s], f);
    const Vector own = {p.tx[m], p.ty[m], p.tz[m]};
    for (std::size_t a = 0; a < 3; ++a) {
      force[a] += f[a];
      torque[a] += own[a] + couple[a];
    }
  }
  const double dt = motion.dt;
  const Vector spin = Spin(c, c.orientation, c.momentum);
  Vector half{};  // momentum at the whole step
  for (std::size_t a = 0; a < 3; ++a) {
    const double acceleration = force[a] / c.mass;
    c.velocity[a] +=
        dt * Damped(acceleration, c.velocity[a] + 0.5 * dt * acceleration, motion.damping);
    const double damped = Damped(torque[a], spin[a], motion.damping);
    half[a] = c.momentum[a] + 0.5 * dt * damped;
    c.momentum[a] += dt * damped;
  }
  const Quaternion middle = Rotate(c.orientation, Spin(c, c.orientation, half), 0.5 * dt);
  const Vector turning = Spin(c, middle, c.momentum);
  c.orientation = Rotate(c.orientation, turning, dt);

  const Vector flow = {motion.stretch[0] * c.centre[0] + motion.shear * c.centre[2],
                       motion.stretch[1] * c.centre[1], motion.stretch[2] * c.centre[2]};
  for (std::size_t a = 0; a < 3; ++a) {
    c.centre[a] += dt * (c.velocity[a] + flow[a]);
  }
  const double inverse_dt = dt > 0 ? 1.0 / dt : 0.0;
  for (std::size_t s = 0; s < c.members.size(); ++s) {
    const auto m = static_cast<std::size_t>(c.members[s]);
    const Vector before = c.arm[s];
    const Vector arm = Turn(c.orientation, c.at[s]);
    c.arm[s] = arm;
    const std::array<int, 3>& image = c.image[s];
    p.x[m] = c.centre[0] + arm[0] + image[0] * cell.length[0] + image[2] * cell.Tilt();
    p.y[m] = c.centre[1] + arm[1] + image[1] * cell.length[1];
    p.z[m] = c.centre[2] + arm[2] + image[2] * cell.length[2];
    // The cell's flow over the arm is no motion of the body.
    p.vx[m] = c.velocity[0] + (arm[0] - before[0]) * inverse_dt -
              (motion.stretch[0] * before[0] + motion.shear * before[2]);
    p.vy[m] = c.velocity[1] + (arm[1] - before[1]) * inverse_dt - motion.stretch[1] * before[1];
    p.vz[m] = c.velocity[2] + (arm[2] - before[2]) * inverse_dt - motion.stretch[2] * before[2];
    p.wx[m] = turning[0];
    p.wy[m] = turning[1];
    p.wz[m] = turning[2];
    const bool first = s == 0;
    p.fx[m] = first ? force[0] : 0.0;
    p.fy[m] = first ? force[1] : 0.0;
    p.fz[m] = first ? force[2] : 0.0;
    p.tx[m] = first ? torque[0] : 0.0;
    p.ty[m] = first ? torque[1] : 0.0;
    p.tz[m] = first ? torque[2] : 0.0;
  }
}

}  // namespace

RigidClumps::RigidClumps(const Packing& packing, double density, ParticleArrays& particles) {
  std::map<int, std::vector<int>> members;  // by the id in the packing
  for (int k = 0; k < particles.size(); ++k) {
    const int id =
        packing.clump[static_cast<std::size_t>(particles.id[static_cast<std::size_t>(k)])];
    if (id >= 0) {
      members[id].push_back(k);
    }
  }
  std::vector<std::vector<int>> bodies;
  for (auto& [id, list] : members) {
    if (list.size() > 1) {
      bodies.push_back(std::move(list));
    }
  }
  // In the order of their first members, which does not depend on how the file numbers them.
  std::sort(bodies.begin(), bodies.end());
  if (bodies.empty()) {
    return;
  }
  particles.body.assign(particles.x.size(), -1);
  for (const std::vector<int>& body : bodies) {
    for (const int m : body) {
      particles.body[static_cast<std::size_t>(m)] = static_cast<int>(clumps_.size());
    }
    clumps_.push_back(MakeClump(body, packing, density, particles));
  }
}

void RigidClumps::Advance(const Motion& motion, const PeriodicCell& cell, int threads,
                          ParticleArrays& particles) {
  const int count = static_cast<int>(clumps_.size());
  ForEachChunk(ChunkCount(count, kClumpChunk), threads, [&](int chunk) {
    const int end = std::min(count, (chunk + 1) * kClumpChunk);
    for (int c = chunk * kClumpChunk; c < end; ++c) {
      AdvanceOne(motion, cell, clumps_[static_cast<std::size_t>(c)], particles);
    }
  });
}

void RigidClumps::Rewrap(const PeriodicCell& cell, const ParticleArrays& p) {
  for (Clump& c : clumps_) {
    for (std::size_t s = 0; s < c.members.size(); ++s) {
      const auto m = static_cast<std::size_t>(c.members[s]);
      const double dx = p.x[m] - c.centre[0] - c.arm[s][0];
      const double dy = p.y[m] - c.centre[1] - c.arm[s][1];
      const double dz = p.z[m] - c.centre[2] - c.arm[s][2];
      const auto layers = static_cast<int>(std::lround(dz / cell.length[2]));
      c.image[s] = {static_cast<int>(std::lround((dx - layers * cell.Tilt()) / cell.length[0])),
                    static_cast<int>(std::lround(dy / cell.length[1])), layers};
    }
  }
}

void RigidClumps::Fold(std::vector<std::array<double, 6>>& stiffness) const {
  for (const Clump& c : clumps_) {
    std::array<double, 6> sum{};
    for (std::size_t s = 0; s < c.members.size(); ++s) {
      auto& own = stiffness[static_cast<std::size_t>(c.members[s])];
      const Vector& arm = c.arm[s];
      const double leverage =
          (own[0] + own[1] + own[2]) * (arm[0] * arm[0] + arm[1] * arm[1] + arm[2] * arm[2]);
      for (std::size_t a = 0; a < 3; ++a) {
        sum[a] += own[a];
        sum[a + 3] += own[a + 3] + leverage;
      }
      own = {};
    }
    stiffness[static_cast<std::size_t>(c.members.front())] = sum;
  }
}

}  // namespace calib::dem
