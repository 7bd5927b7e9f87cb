#include "dem/dynamics/rigid_clumps.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <map>
#include <utility>

#include "dem/contact/simd.h"
#include "dem/dynamics/chunks.h"
#include "dem/elementary/functions.h"
#include "dem/particles/disk_pair.h"
#include "dem/particles/union_of_spheres.h"

namespace calib::dem {
namespace {

using Vector = std::array<double, 3>;
using Quaternion = std::array<double, 4>;

/// Bodies of a chunk move kLanes at a time, each in a lane of its own.
constexpr int kLanes = 8;
/// Bodies of a chunk [-]. Chosen: enough work for a thread at a time.
constexpr int kClumpChunk = 8 * kLanes;

// Plain members, so that a loop over lanes vectorises.
struct Vec {
  double x, y, z;
};
struct Turned {  // a quaternion
  double w, x, y, z;
};

inline Vec Cross(const Vec& a, const Vec& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/// Principal to cell axes.
inline Vec Turn(const Turned& q, const Vec& v) {
  const Vec u = {q.x, q.y, q.z};
  const Vec t = Cross(u, v);
  const Vec twice = {2 * t.x, 2 * t.y, 2 * t.z};
  const Vec more = Cross(u, twice);
  return {v.x + q.w * twice.x + more.x, v.y + q.w * twice.y + more.y, v.z + q.w * twice.z + more.z};
}

inline Vec TurnBack(const Turned& q, const Vec& v) { return Turn({q.w, -q.x, -q.y, -q.z}, v); }

/// q after a rotation by the angular velocity w during dt: (1, w dt/2) q, normalised; the angle is
/// 2 arctan(w dt/2), right to third order.
inline Turned Rotate(const Turned& q, const Vec& w, double dt) {
  const double x = 0.5 * dt * w.x;
  const double y = 0.5 * dt * w.y;
  const double z = 0.5 * dt * w.z;
  const Turned r = {q.w - x * q.x - y * q.y - z * q.z, q.x + x * q.w + y * q.z - z * q.y,
                    q.y + y * q.w + z * q.x - x * q.z, q.z + z * q.w + x * q.y - y * q.x};
  const double scale = 1.0 / std::sqrt(r.w * r.w + r.x * r.x + r.y * r.y + r.z * r.z);
  return {r.w * scale, r.x * scale, r.y * scale, r.z * scale};
}

/// Angular velocity of a body of this momentum, cell axes.
inline Vec Spin(const Turned& q, const Vec& inertia, const Vec& momentum) {
  const Vec local = TurnBack(q, momentum);
  return Turn(q, {local.x / inertia.x, local.y / inertia.y, local.z / inertia.z});
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
  const Turned unit = Rotate({q[0], q[1], q[2], q[3]}, {0, 0, 0}, 0);  // normalised
  return {unit.w, unit.x, unit.y, unit.z};
}

/// In the plane turning about y is all there is: the same moment about every axis does that alone.
void TakePlanarMoments(const std::vector<Sphere>& spheres, const ClumpMatter& matter, Clump& c) {
  double moment = 0;
  if (matter.thickness > 0) {
    const Sphere& a = spheres.front();
    const Sphere& b = spheres.back();
    assert(spheres.size() == 2 && a.radius == b.radius);
    const PlateMoments plate = MomentsOfDiskPair(
        a.radius,
        std::min(a.radius, 0.5 * Hypotenuse(b.centre[0] - a.centre[0], b.centre[2] - a.centre[2])));
    c.volume = matter.thickness * plate.area;
    moment = matter.thickness * plate.polar;
    for (std::size_t k = 0; k < 3; ++k) {
      c.centre[k] = 0.5 * (a.centre[k] + b.centre[k]);
    }
  } else {
    const SolidMoments solid = MomentsOfUnion(spheres);
    c.volume = solid.volume;
    moment = solid.inertia[1][1];
    c.centre = solid.centroid;
  }
  c.centre[1] = spheres.front().centre[1];  // to the last bit
  c.orientation = {1, 0, 0, 0};
  c.inertia.fill(matter.density * moment);
}

void TakeMoments(const std::vector<Sphere>& spheres, const ClumpMatter& matter, Clump& c) {
  const SolidMoments moments = MomentsOfUnion(spheres);
  const PrincipalMoments principal = Diagonalize(moments.inertia);
  c.volume = moments.volume;
  c.centre = moments.centroid;
  c.orientation = FromAxes(principal.axes);
  for (std::size_t a = 0; a < 3; ++a) {
    c.inertia[a] = matter.density * principal.moment[a];
  }
}

Clump MakeClump(const std::vector<int>& members, const double* length, const ClumpMatter& matter,
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
      const double turns = std::round((centre[a] - base[a]) / length[a]);
      centre[a] -= turns * length[a];
    }
    spheres.push_back({.centre = centre, .radius = p.radius[k]});
  }
  if (matter.planar) {
    TakePlanarMoments(spheres, matter, c);
  } else {
    TakeMoments(spheres, matter, c);
  }
  c.mass = matter.density * c.volume;
  for (std::size_t s = 0; s < spheres.size(); ++s) {
    Vector arm{};
    for (std::size_t a = 0; a < 3; ++a) {
      arm[a] = spheres[s].centre[a] - c.centre[a];
    }
    c.arm.push_back(arm);
    const Quaternion& q = c.orientation;
    const Vec at = TurnBack({q[0], q[1], q[2], q[3]}, {arm[0], arm[1], arm[2]});
    c.at.push_back({at.x, at.y, at.z});
    const auto k = static_cast<std::size_t>(members[s]);
    p.inverse_mass[k] = 1.0 / c.mass;
    p.inverse_inertia[k] = 1.0 / c.inertia[0];
  }
  c.image.resize(members.size());
  return c;
}

/// Leapfrog kick of one component with local damping, as for spheres (leapfrog.h).
inline double Damped(double load, double velocity, double damping) {
  const double factor = load * velocity > 0 ? 1.0 - damping : 1.0 + damping;
  return load * factor;
}

/// Bodies side by side: component, then lane. Lanes without a body hold one that rests.
struct BodyLanes {
  double mass[kLanes];
  double inertia[3][kLanes];
  double centre[3][kLanes];
  double velocity[3][kLanes];
  double momentum[3][kLanes];
  double orientation[4][kLanes];
  double force[3][kLanes];
  double torque[3][kLanes];
  double spin[3][kLanes];  ///< at mid-step
};

void Load(const Clump& c, int lane, BodyLanes& b) {
  b.mass[lane] = c.mass;
  for (std::size_t a = 0; a < 3; ++a) {
    b.inertia[a][lane] = c.inertia[a];
    b.centre[a][lane] = c.centre[a];
    b.velocity[a][lane] = c.velocity[a];
    b.momentum[a][lane] = c.momentum[a];
  }
  for (std::size_t a = 0; a < 4; ++a) {
    b.orientation[a][lane] = c.orientation[a];
  }
}

void Store(const BodyLanes& b, int lane, Clump& c) {
  for (std::size_t a = 0; a < 3; ++a) {
    c.centre[a] = b.centre[a][lane];
    c.velocity[a] = b.velocity[a][lane];
    c.momentum[a] = b.momentum[a][lane];
  }
  for (std::size_t a = 0; a < 4; ++a) {
    c.orientation[a] = b.orientation[a][lane];
  }
}

/// Loads of the members, about the centre of mass, where the weight acts.
void TakeLoads(const Clump& c, const Vec3& gravity, const ParticleArrays& p, int lane,
               BodyLanes& b) {
  Vec force = {c.mass * gravity.x, c.mass * gravity.y, c.mass * gravity.z};
  Vec torque = {0, 0, 0};
  const int* const members = c.members.data();
  const Vector* const arms = c.arm.data();
  for (std::size_t s = 0; s < c.members.size(); ++s) {
    const auto m = static_cast<std::size_t>(members[s]);
    const Vec f = {p.fx[m], p.fy[m], p.fz[m]};
    const Vec couple = Cross({arms[s][0], arms[s][1], arms[s][2]}, f);
    force = {force.x + f.x, force.y + f.y, force.z + f.z};
    torque = {torque.x + (p.tx[m] + couple.x), torque.y + (p.ty[m] + couple.y),
              torque.z + (p.tz[m] + couple.z)};
  }
  const double of[6] = {force.x, force.y, force.z, torque.x, torque.y, torque.z};
  for (int a = 0; a < 3; ++a) {
    b.force[a][lane] = of[a];
    b.torque[a][lane] = of[a + 3];
  }
}

CALIB_DEM_CLONES void AdvanceBodies(const Motion& motion, BodyLanes& b) {
  const double dt = motion.dt;
  const double damping = motion.damping;
  const double stretch[3] = {motion.stretch[0], motion.stretch[1], motion.stretch[2]};
  const double shear = motion.shear;
  for (int l = 0; l < kLanes; ++l) {
    const Turned q = {b.orientation[0][l], b.orientation[1][l], b.orientation[2][l],
                      b.orientation[3][l]};
    const Vec inertia = {b.inertia[0][l], b.inertia[1][l], b.inertia[2][l]};
    const Vec before = {b.momentum[0][l], b.momentum[1][l], b.momentum[2][l]};
    const Vec spin = Spin(q, inertia, before);
    const Vec damped = {Damped(b.torque[0][l], spin.x, damping),
                        Damped(b.torque[1][l], spin.y, damping),
                        Damped(b.torque[2][l], spin.z, damping)};
    const Vec half = {before.x + 0.5 * dt * damped.x, before.y + 0.5 * dt * damped.y,
                      before.z + 0.5 * dt * damped.z};  // at the whole step
    const Vec after = {before.x + dt * damped.x, before.y + dt * damped.y,
                       before.z + dt * damped.z};
    const Turned middle = Rotate(q, Spin(q, inertia, half), 0.5 * dt);
    const Vec turning = Spin(middle, inertia, after);
    const Turned next = Rotate(q, turning, dt);
    b.momentum[0][l] = after.x;
    b.momentum[1][l] = after.y;
    b.momentum[2][l] = after.z;
    b.orientation[0][l] = next.w;
    b.orientation[1][l] = next.x;
    b.orientation[2][l] = next.y;
    b.orientation[3][l] = next.z;
    b.spin[0][l] = turning.x;
    b.spin[1][l] = turning.y;
    b.spin[2][l] = turning.z;
  }
  for (int a = 0; a < 3; ++a) {
    for (int l = 0; l < kLanes; ++l) {
      const double acceleration = b.force[a][l] / b.mass[l];
      b.velocity[a][l] +=
          dt * Damped(acceleration, b.velocity[a][l] + 0.5 * dt * acceleration, damping);
    }
  }
  if (motion.drag > 0) {
    const double keep = 1.0 - motion.drag * dt;
    for (int a = 0; a < 3; ++a) {
      for (int l = 0; l < kLanes; ++l) {
        b.velocity[a][l] *= keep;
        b.momentum[a][l] *= keep;
      }
    }
  }
  double flow[3][kLanes];
  for (int l = 0; l < kLanes; ++l) {
    flow[0][l] = stretch[0] * b.centre[0][l] + shear * b.centre[2][l];
    flow[1][l] = stretch[1] * b.centre[1][l];
    flow[2][l] = stretch[2] * b.centre[2][l];
  }
  for (int a = 0; a < 3; ++a) {
    for (int l = 0; l < kLanes; ++l) {
      b.centre[a][l] += dt * (b.velocity[a][l] + flow[a][l]);
    }
  }
}

/// Places members and gives them velocities; the body's loads stand at the first.
void PlaceMembers(const Motion& motion, const PeriodicCell& cell, const BodyLanes& b, int lane,
                  Clump& c, ParticleArrays& p) {
  const Turned q = {b.orientation[0][lane], b.orientation[1][lane], b.orientation[2][lane],
                    b.orientation[3][lane]};
  const double inverse_dt = motion.dt > 0 ? 1.0 / motion.dt : 0.0;
  const double tilt = cell.Tilt();
  const int* const members = c.members.data();
  const Vector* const at = c.at.data();
  const std::array<int, 3>* const images = c.image.data();
  Vector* const arms = c.arm.data();
  for (std::size_t s = 0; s < c.members.size(); ++s) {
    const auto m = static_cast<std::size_t>(members[s]);
    const Vec before = {arms[s][0], arms[s][1], arms[s][2]};
    const Vec arm = Turn(q, {at[s][0], at[s][1], at[s][2]});
    arms[s] = {arm.x, arm.y, arm.z};
    const std::array<int, 3>& image = images[s];
    p.x[m] = b.centre[0][lane] + arm.x + image[0] * cell.length[0] + image[2] * tilt;
    p.y[m] = b.centre[1][lane] + arm.y + image[1] * cell.length[1];
    p.z[m] = b.centre[2][lane] + arm.z + image[2] * cell.length[2];
    // The cell's flow over the arm is no motion of the body.
    p.vx[m] = b.velocity[0][lane] + (arm.x - before.x) * inverse_dt -
              (motion.stretch[0] * before.x + motion.shear * before.z);
    p.vy[m] = b.velocity[1][lane] + (arm.y - before.y) * inverse_dt - motion.stretch[1] * before.y;
    p.vz[m] = b.velocity[2][lane] + (arm.z - before.z) * inverse_dt - motion.stretch[2] * before.z;
    p.wx[m] = b.spin[0][lane];
    p.wy[m] = b.spin[1][lane];
    p.wz[m] = b.spin[2][lane];
    const bool first = s == 0;
    p.fx[m] = first ? b.force[0][lane] : 0.0;
    p.fy[m] = first ? b.force[1][lane] : 0.0;
    p.fz[m] = first ? b.force[2][lane] : 0.0;
    p.tx[m] = first ? b.torque[0][lane] : 0.0;
    p.ty[m] = first ? b.torque[1][lane] : 0.0;
    p.tz[m] = first ? b.torque[2][lane] : 0.0;
  }
}

/// Nothing acts on it and it turns to nowhere.
void FillWithRest(BodyLanes& b) {
  b = {};
  for (int l = 0; l < kLanes; ++l) {
    b.mass[l] = 1;
    b.inertia[0][l] = b.inertia[1][l] = b.inertia[2][l] = 1;
    b.orientation[0][l] = 1;
  }
}

}  // namespace

RigidClumps::RigidClumps(const Packing& packing, const ClumpMatter& matter,
                         ParticleArrays& particles) {
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
    Add(body, packing.length, matter, particles);
  }
}

void RigidClumps::Add(const std::vector<int>& members, const double* length,
                      const ClumpMatter& matter, ParticleArrays& particles) {
  for (const int m : members) {
    particles.body[static_cast<std::size_t>(m)] = static_cast<int>(clumps_.size());
  }
  Clump clump = MakeClump(members, length, matter, particles);
  const auto first = static_cast<std::size_t>(members.front());
  clump.velocity = {particles.vx[first], particles.vy[first], particles.vz[first]};
  clumps_.push_back(std::move(clump));
}

void RigidClumps::Advance(const Motion& motion, const Vec3& gravity, const PeriodicCell& cell,
                          int threads, ParticleArrays& particles) {
  const int count = static_cast<int>(clumps_.size());
  ForEachChunk(ChunkCount(count, kClumpChunk), threads, [&](int chunk) {
    const int end = std::min(count, (chunk + 1) * kClumpChunk);
    BodyLanes lanes{};
    for (int first = chunk * kClumpChunk; first < end; first += kLanes) {
      const int bodies = std::min(kLanes, end - first);
      if (bodies < kLanes) {
        FillWithRest(lanes);
      }
      Clump* const block = clumps_.data() + first;
      for (int l = 0; l < bodies; ++l) {
        Load(block[l], l, lanes);
        TakeLoads(block[l], gravity, particles, l, lanes);
      }
      AdvanceBodies(motion, lanes);
      for (int l = 0; l < bodies; ++l) {
        Store(lanes, l, block[l]);
        PlaceMembers(motion, cell, lanes, l, block[l], particles);
      }
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

void RigidClumps::Fold(std::vector<OwnStiffness>& stiffness) const {
  for (const Clump& c : clumps_) {
    OwnStiffness sum{};
    for (std::size_t s = 0; s < c.members.size(); ++s) {
      OwnStiffness& own = stiffness[static_cast<std::size_t>(c.members[s])];
      const Vector& arm = c.arm[s];
      const double leverage = (own.translation[0] + own.translation[1] + own.translation[2]) *
                              (arm[0] * arm[0] + arm[1] * arm[1] + arm[2] * arm[2]);
      for (std::size_t a = 0; a < 3; ++a) {
        sum.translation[a] += own.translation[a];
        sum.rotation[a] += own.rotation[a] + leverage;
        sum.moment[a] += own.moment[a];
      }
      own = {};
    }
    stiffness[static_cast<std::size_t>(c.members.front())] = sum;
  }
}

void RigidClumps::Renumber(const std::vector<int>& to, std::vector<int>& body) {
  std::vector<int> now;
  int next = 0;
  for (Clump& clump : clumps_) {
    const bool leaves = to[static_cast<std::size_t>(clump.members.front())] < 0;
    now.push_back(leaves ? -1 : next++);
    for (int& member : clump.members) {
      member = to[static_cast<std::size_t>(member)];
      assert((member < 0) == leaves);
    }
  }
  std::erase_if(clumps_, [](const Clump& clump) { return clump.members.front() < 0; });
  for (int& of : body) {
    of = of < 0 ? -1 : now[static_cast<std::size_t>(of)];
  }
}

}  // namespace calib::dem
