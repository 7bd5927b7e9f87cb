// Grains that join and leave.
#include <algorithm>
#include <cassert>
#include <numeric>

#include "dem/dynamics/assembly.h"

namespace calib::dem {
namespace {

constexpr int kGone = -1;  ///< new index of a grain that is taken out

/// Leaves out the grains whose new index is kGone; the others stay in order.
void DropGone(const std::vector<int>& to, ParticleArrays& p) {
  for (auto* a : {&p.x, &p.y, &p.z, &p.vx, &p.vy, &p.vz, &p.wx, &p.wy, &p.wz, &p.fx, &p.fy, &p.fz,
                  &p.tx, &p.ty, &p.tz, &p.radius, &p.inverse_mass, &p.inverse_inertia}) {
    std::size_t kept = 0;
    for (std::size_t g = 0; g < to.size(); ++g) {
      if (to[g] != kGone) {
        (*a)[kept++] = (*a)[g];
      }
    }
    a->resize(kept);
  }
  std::size_t kept = 0;
  for (std::size_t g = 0; g < to.size(); ++g) {
    if (to[g] != kGone) {
      if (!p.material.empty()) {
        p.material[kept] = p.material[g];
      }
      if (!p.body.empty()) {
        p.body[kept] = p.body[g];
      }
      p.id[kept++] = p.id[g];
    }
  }
  p.id.resize(kept);
  p.body.resize(p.body.empty() ? 0 : kept);
  p.material.resize(p.material.empty() ? 0 : kept);
}

}  // namespace

void Assembly::Renumber(const std::vector<int>& to) {
  // The next search reads pairs in order and their memory, which stays where it is.
  std::size_t kept = 0;
  for (const int slot : order_) {
    const auto s = static_cast<std::size_t>(slot);
    list_.first[s] = to[static_cast<std::size_t>(list_.first[s])];
    list_.second[s] = to[static_cast<std::size_t>(list_.second[s])];
    if (list_.first[s] == kGone || list_.second[s] == kGone) {
      touching_[s] = 0;
    } else {
      order_[kept++] = slot;
    }
  }
  order_.resize(kept);
  walls_.Renumber(to);
  stale_ = true;
  loads_fit_ = false;
}

void Assembly::Remove(const std::vector<int>& grains) {
  if (grains.empty()) {
    return;
  }
  std::vector<int> to(particles_.x.size(), 0);
  for (const int g : grains) {
    const auto q = static_cast<std::size_t>(g);
    to[q] = kGone;
    const int clump = particles_.body.empty() ? -1 : particles_.body[q];
    if (clump < 0 || clumps_.all()[static_cast<std::size_t>(clump)].members.front() == g) {
      solid_volume_ -= 1.0 / (particles_.inverse_mass[q] * DensityOf(MaterialOf(q)));
    }
  }
  int next = 0;
  for (int& index : to) {
    index = index == kGone ? kGone : next++;
  }
  Renumber(to);
  clumps_.Renumber(to, particles_.body);
  DropGone(to, particles_);
}

void Assembly::Relocate(int clump, const Vec3& shift) {
  Clump& body = clumps_.mutable_all()[static_cast<std::size_t>(clump)];
  std::vector<int> to(particles_.x.size());
  std::iota(to.begin(), to.end(), 0);
  for (const int member : body.members) {
    to[static_cast<std::size_t>(member)] = kGone;
  }
  Renumber(to);  // forgets its contacts
  ParticleArrays& p = particles_;
  for (const int member : body.members) {
    const auto m = static_cast<std::size_t>(member);
    p.x[m] += shift.x;
    p.y[m] += shift.y;
    p.z[m] += shift.z;
    for (auto* a : {&p.vx, &p.vy, &p.vz, &p.wx, &p.wy, &p.wz}) {
      (*a)[m] = 0;
    }
  }
  body.centre = {body.centre[0] + shift.x, body.centre[1] + shift.y, body.centre[2] + shift.z};
  body.velocity = {};
  body.momentum = {};
}

void Assembly::Insert(const std::vector<NewGrain>& grains) {
  ParticleArrays& p = particles_;
  const bool clumps = std::any_of(grains.begin(), grains.end(),
                                  [](const NewGrain& grain) { return grain.clump >= 0; });
  if (clumps && p.body.empty()) {
    p.body.assign(p.x.size(), -1);
  }
  std::vector<std::vector<int>> bodies;
  int last = -1;
  for (const NewGrain& grain : grains) {
    assert(grain.radius > 0 && grain.radius <= largest_radius_ * (1 + 1e-12));
    const double density = DensityOf(grain.material);
    const Inertia inertia = InertiaOf(grain.radius, density, thickness_);
    for (auto* a : {&p.wx, &p.wy, &p.wz, &p.fx, &p.fy, &p.fz, &p.tx, &p.ty, &p.tz}) {
      a->push_back(0);
    }
    p.x.push_back(grain.centre.x);
    p.y.push_back(grain.centre.y);
    p.z.push_back(grain.centre.z);
    p.vx.push_back(grain.velocity.x);
    p.vy.push_back(grain.velocity.y);
    p.vz.push_back(grain.velocity.z);
    p.radius.push_back(grain.radius);
    p.inverse_mass.push_back(1.0 / inertia.mass);
    p.inverse_inertia.push_back(1.0 / inertia.moment);
    p.id.push_back(next_id_++);
    if (model_.materials() != nullptr) {
      p.material.push_back(static_cast<std::uint8_t>(grain.material));
    }
    if (!p.body.empty() || clumps) {
      p.body.push_back(-1);
    }
    if (grain.clump < 0) {
      solid_volume_ += inertia.mass / density;
    } else if (grain.clump == last) {
      bodies.back().push_back(p.size() - 1);
    } else {
      bodies.push_back({p.size() - 1});
    }
    last = grain.clump;
  }
  for (const std::vector<int>& body : bodies) {
    clumps_.Add(body, cell_.length, ClumpMatterOf(density_), p);
    solid_volume_ += clumps_.all().back().volume;
  }
  stale_ = true;
  loads_fit_ = false;
}

}  // namespace calib::dem
