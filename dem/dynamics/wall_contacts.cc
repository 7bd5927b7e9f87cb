// Contacts with walls of the present configuration, through the same chain of kernels as those
// between grains.
#include "dem/dynamics/wall_contacts.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "dem/dynamics/chunks.h"

namespace calib::dem {
namespace {

/// Grains at walls in a chunk [-]. Chosen: enough work for a thread at a time. Changing it may
/// change bits.
constexpr int kRowChunk = 64;

/// Distance over the radius below which nearest points are one [-]. Chosen: far above rounding, far
/// below grains.
constexpr double kSamePlace = 1e-7;

/// Way over the radius below which a contact of the step before is taken to be the same one [-].
/// Chosen: far more than a step's way, far less than a grain.
constexpr double kSameContact = 0.1;

/// A triangle or plane within range, before contacts are told from each other. Left without values
/// on purpose: room for many is set aside for every grain at a wall.
struct Near {
  int candidate;
  int wall;
  double x, y, z;  ///< nearest point
  double distance2;

  [[nodiscard]] Vec3 point() const { return {x, y, z}; }
};

}  // namespace

double WallContacts::FrictionOf(int wall, const ContactModel& model, int pair) const {
  const Wall& w = walls_[static_cast<std::size_t>(wall)];
  return w.friction.value_or(model.materials() == nullptr ? model.wall_friction()
                                                          : model.materials()->friction(pair));
}

void WallContacts::FindContacts(const ParticleArrays& p, const Step& step, std::size_t r,
                                ChunkResult& result) {
  constexpr int kMostNear = 64;  // triangles within range of a grain [-], chosen: more end the run
  Row& row = rows_[r];
  const auto g = static_cast<std::size_t>(row.grain);
  const Vec3 centre{p.x[g], p.y[g], p.z[g]};
  const double radius = p.radius[g];
  const double range = radius + step.reach;
  const double out_of_range = range * (1 + 1e-9) + step.moved + moved_;  // at the search
  const auto end = static_cast<std::size_t>(
      r + 1 < rows_.size() ? rows_[r + 1].first : static_cast<int>(candidates_.size()));
  Near near[kMostNear];
  int count = 0;
  for (auto c = static_cast<std::size_t>(row.first); c < end; ++c) {
    if (candidates_[c].distance > out_of_range) {
      continue;
    }
    const Vec3 point = NearestOn(candidates_[c], centre);
    const Vec3 d = point - centre;
    const double distance2 = Dot(d, d);
    if (distance2 < range * range) {
      if (count == kMostNear) {
        result.crowded = row.grain;
        return;
      }
      near[count++] = {.candidate = static_cast<int>(c),
                       .wall = candidates_[c].wall,
                       .x = point.x,
                       .y = point.y,
                       .z = point.z,
                       .distance2 = distance2};
    }
  }
  if (count == 0 && row.contacts == 0) {
    return;
  }
  std::sort(near, near + count, [](const Near& a, const Near& b) {
    return a.distance2 != b.distance2 ? a.distance2 < b.distance2 : a.candidate < b.candidate;
  });
  const double same = kSamePlace * radius;
  const auto apart = [](const Vec3& a, const Vec3& b) { return Length(a - b); };
  struct Now {
    int before;  ///< the contact that this one goes on from, -1: it is new
    const Near* at;
  };
  Now now[kMost];
  bool claimed[kMost] = {};
  int contacts = 0;
  for (int k = 0; k < count; ++k) {
    bool real = true;  // a local minimum of the distance to this wall that is not there yet
    for (int other = 0; other < count && real; ++other) {
      if (other == k || near[other].wall != near[k].wall) {
        continue;
      }
      if (apart(near[other].point(), near[k].point()) <= same) {
        real = other > k;
      } else if (near[other].distance2 < near[k].distance2) {
        const Candidate& triangle = candidates_[static_cast<std::size_t>(near[other].candidate)];
        real = apart(NearestOn(triangle, near[k].point()), near[k].point()) > same;
      }
    }
    if (!real) {
      continue;
    }
    int before = -1;
    double nearest = kSameContact * radius;
    for (int c = 0; c < row.contacts; ++c) {
      const Contact& old = ContactOf(row, c);
      const double moved = apart(old.point, near[k].point());
      if (!claimed[c] && old.wall == near[k].wall && moved < nearest) {
        before = c;
        nearest = moved;
      }
    }
    const bool overlaps = near[k].distance2 < radius * radius;
    if (!overlaps && before < 0) {
      continue;  // contacts form on touching only
    }
    if (contacts == kMost) {
      result.crowded = row.grain;
      return;
    }
    if (before >= 0) {
      claimed[before] = true;
    }
    now[contacts++] = {.before = before, .at = &near[k]};
  }
  bool in_place = true;
  for (int c = 0; c < contacts; ++c) {
    in_place = in_place && (now[c].before == c || (now[c].before < 0 && c >= row.contacts));
  }
  if (!in_place) {
    const std::vector<Contact> old(&ContactOf(row, 0), &ContactOf(row, 0) + row.contacts);
    for (int c = 0; c < contacts; ++c) {
      ContactOf(row, c) =
          now[c].before < 0 ? Contact{} : old[static_cast<std::size_t>(now[c].before)];
    }
  }
  for (int c = 0; c < contacts; ++c) {
    Contact& contact = ContactOf(row, c);
    if (now[c].before < 0) {
      contact = Contact{};
    }
    contact.wall = now[c].at->wall;
    contact.point = now[c].at->point();
  }
  row.contacts = contacts;
}

void WallContacts::LoadLane(const ParticleArrays& p, const ContactModel& model, const Row& row,
                            const Contact& contact, ContactBlock& b) const {
  const int k = b.count++;
  const auto g = static_cast<std::size_t>(row.grain);
  const Wall& wall = walls_[static_cast<std::size_t>(contact.wall)];
  const Vec3 d = contact.point - Vec3{p.x[g], p.y[g], p.z[g]};
  const Vec3 v = wall.VelocityAt(contact.point) - Vec3{p.vx[g], p.vy[g], p.vz[g]};
  b.pair[k] = row.grain;
  b.dx[k] = d.x;
  b.dy[k] = d.y;
  b.dz[k] = d.z;
  b.radius_i[k] = b.radius_j[k] = p.radius[g];
  b.vx[k] = v.x;
  b.vy[k] = v.y;
  b.vz[k] = v.z;
  b.wix[k] = p.wx[g];
  b.wiy[k] = p.wy[g];
  b.wiz[k] = p.wz[g];
  b.wjx[k] = wall.angular_velocity.x;
  b.wjy[k] = wall.angular_velocity.y;
  b.wjz[k] = wall.angular_velocity.z;
  for (int c = 0; c < model.history_size(); ++c) {
    b.history[c][k] = contact.history[c];
  }
  if (model.materials() != nullptr) {
    b.mixed = true;
    b.materials[k] = PairOf(p, row.grain, model);
    b.friction[k] = FrictionOf(contact.wall, model, b.materials[k]);
  }
}

void WallContacts::EvaluateChunk(const ParticleArrays& p, const ContactModel& model,
                                 const Step& step, int chunk, ChunkResult& result) {
  result.force.assign(walls_.size(), Vec3{});
  result.contacts = 0;
  result.crowded = -1;
  const auto begin = static_cast<std::size_t>(chunk) * kRowChunk;
  const auto end = std::min(begin + kRowChunk, rows_.size());
  ContactBlock block;
  block.wall = true;
  block.mass_factor = 2;
  block.dt = step.dt;
  block.viscous = step.viscous ? 1.0 : 0.0;
  struct Lane {
    Row* row;
    Contact* contact;
  };
  Lane lanes[kBlock];
  const auto flush = [&] {
    if (block.count == 0) {
      return;
    }
    PadLanes(model.history_size(), block);
    model.Evaluate(block);
    for (int k = 0; k < block.count; ++k) {
      Contact& contact = *lanes[k].contact;
      const bool overlaps = block.overlap[k] > 0;
      if (!overlaps && !(block.holds[k] > 0)) {
        contact.wall = -1;
        continue;
      }
      const Vec3 force{block.force_x[k], block.force_y[k], block.force_z[k]};
      GrainLoad& load = lanes[k].row->load;
      load.force[0] -= force.x;
      load.force[1] -= force.y;
      load.force[2] -= force.z;
      load.torque[0] += block.torque_ix[k];
      load.torque[1] += block.torque_iy[k];
      load.torque[2] += block.torque_iz[k];
      Vec3& total = result.force[static_cast<std::size_t>(contact.wall)];
      total = total + force;
      result.contacts += overlaps ? 1 : 0;
      for (int c = 0; c < model.history_size(); ++c) {
        contact.history[c] = block.history[c][k];
      }
    }
    block.count = 0;
  };
  for (std::size_t r = begin; r < end; ++r) {
    Row& row = rows_[r];
    FindContacts(p, step, r, result);
    row.load = GrainLoad{};
    for (int c = 0; c < row.contacts; ++c) {
      Contact& contact = ContactOf(row, c);
      const double friction = FrictionOf(contact.wall, model, PairOf(p, row.grain, model));
      if (block.count > 0 && friction != block.sliding_friction) {
        flush();
      }
      block.sliding_friction = friction;
      lanes[block.count] = {&row, &contact};
      LoadLane(p, model, row, contact, block);
      if (block.count == kBlock) {
        flush();
      }
    }
  }
  flush();
  for (std::size_t r = begin; r < end; ++r) {  // contacts that nothing holds have opened
    Row& row = rows_[r];
    if (row.contacts > 0) {
      Contact* const contact = &ContactOf(row, 0);
      row.contacts = static_cast<int>(std::remove_if(contact, contact + row.contacts,
                                                     [](const Contact& c) { return c.wall < 0; }) -
                                      contact);
    }
  }
}

absl::Status WallContacts::Evaluate(const ParticleArrays& p, const ContactModel& model,
                                    const Step& step) {
  const int chunks = ChunkCount(static_cast<int>(rows_.size()), kRowChunk);
  results_.resize(static_cast<std::size_t>(chunks));
  ForEachChunk(chunks, step.threads, [&](int chunk) {
    EvaluateChunk(p, model, step, chunk, results_[static_cast<std::size_t>(chunk)]);
  });
  force_.assign(walls_.size(), Vec3{});
  contacts_ = 0;
  for (const ChunkResult& result : results_) {
    if (result.crowded >= 0) {
      return absl::OutOfRangeError(absl::StrCat(
          "grain ", p.id[static_cast<std::size_t>(result.crowded)], " touches more than ", kMost,
          " places of walls at once: their triangles are too small for it"));
    }
    contacts_ += result.contacts;
    for (std::size_t w = 0; w < walls_.size(); ++w) {
      force_[w] = force_[w] + result.force[w];
    }
  }
  return absl::OkStatus();
}

void WallContacts::AddLoads(int begin, int end, ParticleArrays& p) const {
  auto row = std::lower_bound(rows_.begin(), rows_.end(), begin,
                              [](const Row& r, int grain) { return r.grain < grain; });
  for (; row != rows_.end() && row->grain < end; ++row) {
    const auto g = static_cast<std::size_t>(row->grain);
    p.fx[g] += row->load.force[0];
    p.fy[g] += row->load.force[1];
    p.fz[g] += row->load.force[2];
    p.tx[g] += row->load.torque[0];
    p.ty[g] += row->load.torque[1];
    p.tz[g] += row->load.torque[2];
  }
}

}  // namespace calib::dem
