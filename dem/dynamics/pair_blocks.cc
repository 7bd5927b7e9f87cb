#include "dem/dynamics/pair_blocks.h"

#include <algorithm>
#include <cassert>
#include <cstring>

#include "dem/contact/quad.h"
#include "dem/contact/simd.h"
#include "dem/dynamics/chunks.h"

namespace calib::dem {
namespace {

constexpr int kQuad = 4;  ///< doubles of a Quad

/// Three arrays of a ParticleArrays.
template <class Pointer>
struct Three {
  Pointer x, y, z;
};

CALIB_DEM_INLINE void PackFour(const Three<const double*>& from, const double* last, int g,
                               Quad (&row)[4]) {
  LoadQuad(from.x + g, row[0]);
  LoadQuad(from.y + g, row[1]);
  LoadQuad(from.z + g, row[2]);
  if (last == nullptr) {
    row[3] = Quad{0, 0, 0, 0};
  } else {
    LoadQuad(last + g, row[3]);
  }
  Transpose(row);
}

struct Columns {
  Three<const double*> at, velocity, spin;
  const double* radius;
};

CALIB_DEM_CLONES void Pack(const Columns& from, int begin, int end, GrainRecord* records) {
  int g = begin;
  for (; g + kQuad <= end; g += kQuad) {
    Quad at[4];
    Quad velocity[4];
    Quad spin[4];
    PackFour(from.at, from.radius, g, at);
    PackFour(from.velocity, nullptr, g, velocity);
    PackFour(from.spin, from.radius, g, spin);
    for (int l = 0; l < kQuad; ++l) {
      StoreQuad(at[l], records[g + l].at);
      StoreQuad(velocity[l], records[g + l].velocity);
      StoreQuad(spin[l], records[g + l].spin);
    }
  }
  for (; g < end; ++g) {
    records[g] = {{from.at.x[g], from.at.y[g], from.at.z[g], from.radius[g]},
                  {from.velocity.x[g], from.velocity.y[g], from.velocity.z[g], 0.0},
                  {from.spin.x[g], from.spin.y[g], from.spin.z[g], from.radius[g]}};
  }
}

struct LanePairs {
  const int* first;
  const int* second;
  const std::uint8_t* image;
};

CALIB_DEM_CLONES bool Branches(const LanePairs lanes, const GrainRecord* grains,
                               const ImageShift* shift, ContactBlock& block) {
  const Quad sign = {-1.0, -1.0, -1.0, 1.0};  // differences of centres, sum of radii
  QuadMask near = {0, 0, 0, 0};
  for (int k = 0; k < kBlock; k += kQuad) {
    Quad row[4];
    for (int l = 0; l < kQuad; ++l) {
      Quad i;
      Quad j;
      Quad moved;
      LoadQuad(grains[lanes.first[k + l]].at, i);
      LoadQuad(grains[lanes.second[k + l]].at, j);
      LoadQuad(shift[lanes.image[k + l]], moved);
      row[l] = (j + moved) + sign * i;
    }
    Transpose(row);
    StoreQuad(row[0], block.dx + k);
    StoreQuad(row[1], block.dy + k);
    StoreQuad(row[2], block.dz + k);
    near |= row[3] * row[3] > row[0] * row[0] + row[1] * row[1] + row[2] * row[2];
  }
  return (near[0] | near[1] | near[2] | near[3]) != 0;
}

CALIB_DEM_CLONES void Grains(const LanePairs lanes, const GrainRecord* grains, ContactBlock& b) {
  for (int k = 0; k < kBlock; k += kQuad) {
    Quad v[4];
    Quad wi[4];
    Quad wj[4];
    for (int l = 0; l < kQuad; ++l) {
      const GrainRecord& i = grains[lanes.first[k + l]];
      const GrainRecord& j = grains[lanes.second[k + l]];
      Quad vi;
      LoadQuad(j.velocity, v[l]);
      LoadQuad(i.velocity, vi);
      v[l] -= vi;
      LoadQuad(i.spin, wi[l]);
      LoadQuad(j.spin, wj[l]);
    }
    Transpose(v);
    StoreQuad(v[0], b.vx + k);
    StoreQuad(v[1], b.vy + k);
    StoreQuad(v[2], b.vz + k);
    Transpose(wi);
    StoreQuad(wi[0], b.wix + k);
    StoreQuad(wi[1], b.wiy + k);
    StoreQuad(wi[2], b.wiz + k);
    StoreQuad(wi[3], b.radius_i + k);
    Transpose(wj);
    StoreQuad(wj[0], b.wjx + k);
    StoreQuad(wj[1], b.wjy + k);
    StoreQuad(wj[2], b.wjz + k);
    StoreQuad(wj[3], b.radius_j + k);
  }
}

CALIB_DEM_CLONES void ClearUnkept(const double* keep, double* lane) {
  for (int k = 0; k < kBlock; ++k) {
    lane[k] = keep[k] > 0 ? lane[k] : 0.0;
  }
}

/// keep: above zero where the lane acts. Returns how many overlap; acting: how many act.
CALIB_DEM_CLONES int Decide(int count, double reach, const ContactBlock& b, std::uint8_t* touching,
                            double* keep, int& acting) {
  int overlaps = 0;
  int acts = 0;
  for (int k = 0; k < kBlock; ++k) {
    const int used = k < count ? 1 : 0;
    const int over = b.overlap[k] > 0 ? used : 0;
    const int held =
        (touching[k] != 0 ? 1 : 0) & (b.holds[k] > 0 ? 1 : 0) & (b.overlap[k] > -reach ? used : 0);
    const int on = over | held;
    overlaps += over;
    acts += on;
    touching[k] = static_cast<std::uint8_t>(on);
    keep[k] = on;
  }
  acting = acts;
  return overlaps;
}

struct LanePlaces {
  const std::uint16_t* i;
  const std::uint16_t* j;
};

CALIB_DEM_INLINE void AddQuad(const Quad& what, double* to) {
  Quad sum;
  LoadQuad(to, sum);
  sum += what;
  StoreQuad(sum, to);
}

/// Three quantities of four lanes, contact by contact: row[l] = {x[l], y[l], z[l], 0}.
CALIB_DEM_INLINE void Rows(const double* x, const double* y, const double* z, Quad (&row)[4]) {
  LoadQuad(x, row[0]);
  LoadQuad(y, row[1]);
  LoadQuad(z, row[2]);
  row[3] = Quad{0, 0, 0, 0};
  Transpose(row);
}

CALIB_DEM_CLONES void Add(const LanePlaces place, const ContactBlock& b, GrainLoad* loads,
                          BlockForces& forces, LaneSums& sums) {
  const Quad zero = {0, 0, 0, 0};
  Quad sum[4];
  for (int a = 0; a < 4; ++a) {
    LoadQuad(sums.at[a], sum[a]);
  }
  for (int k = 0; k < kBlock; k += kQuad) {
    Quad f[4];
    Quad d[3];
    LoadQuad(b.force_x + k, f[0]);
    LoadQuad(b.force_y + k, f[1]);
    LoadQuad(b.force_z + k, f[2]);
    LoadQuad(b.dx + k, d[0]);
    LoadQuad(b.dy + k, d[1]);
    LoadQuad(b.dz + k, d[2]);
    sum[0] += f[0] * d[0];
    sum[1] += f[1] * d[1];
    sum[2] += f[2] * d[2];
    sum[3] += f[0] * d[2] + f[2] * d[0];
    StoreQuad(f[0], forces.x + k);
    StoreQuad(f[1], forces.y + k);
    StoreQuad(f[2], forces.z + k);
    f[3] = zero;
    Transpose(f);
    Quad ti[4];
    Rows(b.torque_ix + k, b.torque_iy + k, b.torque_iz + k, ti);
    Quad tj[4];
    Rows(b.torque_jx + k, b.torque_jy + k, b.torque_jz + k, tj);
    for (int l = 0; l < kQuad; ++l) {
      GrainLoad& on_i = loads[place.i[k + l]];
      GrainLoad& on_j = loads[place.j[k + l]];
      AddQuad(zero - f[l], on_i.force);
      AddQuad(ti[l], on_i.torque);
      AddQuad(f[l], on_j.force);
      AddQuad(tj[l], on_j.torque);
    }
  }
  for (int a = 0; a < 4; ++a) {
    StoreQuad(sum[a], sums.at[a]);
  }
}

struct Sums {
  Three<double*> force, torque;
};

/// Grains come four at a time, as many places for each as the one with most of them has: how many
/// there are is then seldom guessed wrong. row: of fours.
CALIB_DEM_CLONES void GatherFours(const int* row, const int* place, const GrainLoad* loads,
                                  int begin, int end, const Sums& to) {
  for (int g = begin; g < end; g += kQuad) {
    Quad f[4] = {};
    Quad t[4] = {};
    const int* const last = place + row[g / kQuad + 1];
    for (const int* at = place + row[g / kQuad]; at != last; at += kQuad) {
      for (int l = 0; l < kQuad; ++l) {
        Quad force;
        Quad torque;
        LoadQuad(loads[at[l]].force, force);
        LoadQuad(loads[at[l]].torque, torque);
        f[l] += force;
        t[l] += torque;
      }
    }
    Transpose(f);
    Transpose(t);
    if (g + kQuad <= end) {
      StoreQuad(f[0], to.force.x + g);
      StoreQuad(f[1], to.force.y + g);
      StoreQuad(f[2], to.force.z + g);
      StoreQuad(t[0], to.torque.x + g);
      StoreQuad(t[1], to.torque.y + g);
      StoreQuad(t[2], to.torque.z + g);
    } else {
      for (int l = 0; g + l < end; ++l) {
        to.force.x[g + l] = f[0][l];
        to.force.y[g + l] = f[1][l];
        to.force.z[g + l] = f[2][l];
        to.torque.x[g + l] = t[0][l];
        to.torque.y[g + l] = t[1][l];
        to.torque.z[g + l] = t[2][l];
      }
    }
  }
}

LanePairs PairsOf(const PairLanes& lanes, int b) {
  const auto begin = static_cast<std::ptrdiff_t>(b) * kBlock;
  return {lanes.first.data() + begin, lanes.second.data() + begin, lanes.image.data() + begin};
}

}  // namespace

void PackGrains(const ParticleArrays& p, int begin, int end, GrainRecord* records) {
  Pack({.at = {p.x.data(), p.y.data(), p.z.data()},
        .velocity = {p.vx.data(), p.vy.data(), p.vz.data()},
        .spin = {p.wx.data(), p.wy.data(), p.wz.data()},
        .radius = p.radius.data()},
       begin, end, records);
}

bool LoadBranches(const PairLanes& lanes, int b, const GrainRecord* grains, const ImageShift* shift,
                  ContactBlock& block) {
  return Branches(PairsOf(lanes, b), grains, shift, block);
}

void LoadGrains(const PairLanes& lanes, int b, const GrainRecord* grains, ContactBlock& block) {
  Grains(PairsOf(lanes, b), grains, block);
}

int CloseBlock(int count, double reach, int width, ContactBlock& b, std::uint8_t* touching) {
  alignas(64) double keep[kBlock];
  int acting = 0;
  const int overlaps = Decide(count, reach, b, touching, keep, acting);
  if (acting < kBlock) {
    for (ContactBlock::Lane* lane : {&b.force_x, &b.force_y, &b.force_z, &b.torque_ix, &b.torque_iy,
                                     &b.torque_iz, &b.torque_jx, &b.torque_jy, &b.torque_jz}) {
      ClearUnkept(keep, *lane);
    }
    for (int c = 0; c < width; ++c) {
      ClearUnkept(keep, b.history[c]);
    }
  }
  return overlaps;
}

void AddLoads(const PairLanes& lanes, int b, const ContactBlock& block, GrainLoad* loads,
              BlockForces& forces, LaneSums& sums) {
  const auto begin = static_cast<std::ptrdiff_t>(b) * kBlock;
  Add({lanes.place_i.data() + begin, lanes.place_j.data() + begin}, block, loads, forces, sums);
}

void LoadPlaces::Assign(int grains, PairLanes& lanes) {
  const std::size_t slots = lanes.first.size();
  lanes.place_i.resize(slots);
  lanes.place_j.resize(slots);
  met_.assign(static_cast<std::size_t>(grains), {.chunk = -1, .place = 0, .count = 0});
  grain_of_.clear();
  chunk_row_.assign(1, 0);
  for (std::size_t begin = 0; begin < slots; begin += kPairChunk) {
    const std::size_t end = std::min(begin + kPairChunk, slots);
    const int chunk = static_cast<int>(begin / kPairChunk);
    const auto first_place = static_cast<int>(grain_of_.size());
    // Grains i of a chunk are neighbours in memory, and so their places become.
    for (const auto& [of, to] :
         {std::pair(&lanes.first, &lanes.place_i), std::pair(&lanes.second, &lanes.place_j)}) {
      for (std::size_t s = begin; s < end; ++s) {
        const int grain = (*of)[s];
        Met& met = met_[static_cast<std::size_t>(grain)];
        if (met.chunk != chunk) {
          met.chunk = chunk;
          met.place = static_cast<int>(grain_of_.size()) - first_place;
          ++met.count;
          grain_of_.push_back(grain);
        }
        (*to)[s] = static_cast<std::uint16_t>(met.place);
      }
    }
    chunk_row_.push_back(static_cast<int>(grain_of_.size()));
  }
  const std::size_t fours = (met_.size() + kQuad - 1) / kQuad;
  row_.assign(1, 0);
  for (std::size_t q = 0; q < fours; ++q) {
    int most = 0;
    for (std::size_t g = kQuad * q; g < std::min(kQuad * (q + 1), met_.size()); ++g) {
      most = std::max(most, met_[g].count);
      met_[g].place = row_.back() + static_cast<int>(g % kQuad);
    }
    row_.push_back(row_.back() + kQuad * most);
  }
  const auto nothing = static_cast<int>(grain_of_.size());
  place_.assign(static_cast<std::size_t>(row_.back()), nothing);
  for (int place = 0; place < nothing; ++place) {
    int& next = met_[static_cast<std::size_t>(grain_of_[static_cast<std::size_t>(place)])].place;
    place_[static_cast<std::size_t>(next)] = place;
    next += kQuad;
  }
  load_.assign(grain_of_.size() + 1, GrainLoad{});
}

GrainLoad* LoadPlaces::Clear(int chunk) {
  const auto c = static_cast<std::size_t>(chunk);
  GrainLoad* const begin = load_.data() + chunk_row_[c];
  std::memset(static_cast<void*>(begin), 0,
              sizeof(GrainLoad) * static_cast<std::size_t>(chunk_row_[c + 1] - chunk_row_[c]));
  return begin;
}

void LoadPlaces::Gather(int begin, int end, ParticleArrays& p) const {
  assert(begin % kQuad == 0);
  GatherFours(row_.data(), place_.data(), load_.data(), begin, end,
              {.force = {p.fx.data(), p.fy.data(), p.fz.data()},
               .torque = {p.tx.data(), p.ty.data(), p.tz.data()}});
}

Vec3 LoadPlaces::ForceOn(int grain) const {
  Vec3 sum;
  const auto four = static_cast<std::size_t>(grain / kQuad);
  for (int k = row_[four] + grain % kQuad; k < row_[four + 1]; k += kQuad) {
    const double* const f =
        load_[static_cast<std::size_t>(place_[static_cast<std::size_t>(k)])].force;
    sum = {sum.x + f[0], sum.y + f[1], sum.z + f[2]};
  }
  return sum;
}

}  // namespace calib::dem
