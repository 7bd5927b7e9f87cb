#include "dem/dynamics/pair_blocks.h"

#include "dem/contact/quad.h"
#include "dem/contact/simd.h"

namespace calib::dem {
namespace {

constexpr int kQuad = 4;

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

CALIB_DEM_CLONES void Keep(const double* keep, double* lane) {
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

CALIB_DEM_CLONES void AddStress(const ContactBlock& b, LaneSums& sums) {
  Quad sum[4];
  for (int a = 0; a < 4; ++a) {
    LoadQuad(sums.at[a], sum[a]);
  }
  for (int k = 0; k < kBlock; k += kQuad) {
    Quad f[3];
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
  }
  for (int a = 0; a < 4; ++a) {
    StoreQuad(sum[a], sums.at[a]);
  }
}

struct LanePlaces {
  const int* i;
  const int* j;
};

/// Three quantities of four lanes, contact by contact: row[l] = {x[l], y[l], z[l], 0}.
CALIB_DEM_INLINE void Rows(const double* x, const double* y, const double* z, Quad (&row)[4]) {
  LoadQuad(x, row[0]);
  LoadQuad(y, row[1]);
  LoadQuad(z, row[2]);
  row[3] = Quad{0, 0, 0, 0};
  Transpose(row);
}

CALIB_DEM_CLONES void Leave(const LanePlaces place, const ContactBlock& b, GrainLoad* loads) {
  const Quad zero = {0, 0, 0, 0};
  for (int k = 0; k < kBlock; k += kQuad) {
    Quad f[4];
    Rows(b.force_x + k, b.force_y + k, b.force_z + k, f);
    Quad ti[4];
    Rows(b.torque_ix + k, b.torque_iy + k, b.torque_iz + k, ti);
    Quad tj[4];
    Rows(b.torque_jx + k, b.torque_jy + k, b.torque_jz + k, tj);
    for (int l = 0; l < kQuad; ++l) {
      GrainLoad& on_i = loads[place.i[k + l]];
      GrainLoad& on_j = loads[place.j[k + l]];
      StoreQuad(zero - f[l], on_i.force);
      StoreQuad(ti[l], on_i.torque);
      StoreQuad(f[l], on_j.force);
      StoreQuad(tj[l], on_j.torque);
    }
  }
}

struct Sums {
  Three<double*> force, torque;
};

CALIB_DEM_INLINE void SumRow(const GrainLoad* load, const GrainLoad* end, Quad& force,
                             Quad& torque) {
  force = torque = Quad{0, 0, 0, 0};
  for (; load != end; ++load) {
    Quad f;
    Quad t;
    LoadQuad(load->force, f);
    LoadQuad(load->torque, t);
    force += f;
    torque += t;
  }
}

CALIB_DEM_CLONES void Gather(const int* place_row, const GrainLoad* loads, int begin, int end,
                             const Sums& to) {
  int g = begin;
  for (; g + kQuad <= end; g += kQuad) {
    Quad f[4];
    Quad t[4];
    for (int l = 0; l < kQuad; ++l) {
      SumRow(loads + place_row[g + l], loads + place_row[g + l + 1], f[l], t[l]);
    }
    Transpose(f);
    Transpose(t);
    StoreQuad(f[0], to.force.x + g);
    StoreQuad(f[1], to.force.y + g);
    StoreQuad(f[2], to.force.z + g);
    StoreQuad(t[0], to.torque.x + g);
    StoreQuad(t[1], to.torque.y + g);
    StoreQuad(t[2], to.torque.z + g);
  }
  for (; g < end; ++g) {
    Quad f;
    Quad t;
    SumRow(loads + place_row[g], loads + place_row[g + 1], f, t);
    to.force.x[g] = f[0];
    to.force.y[g] = f[1];
    to.force.z[g] = f[2];
    to.torque.x[g] = t[0];
    to.torque.y[g] = t[1];
    to.torque.z[g] = t[2];
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
      Keep(keep, *lane);
    }
    for (int c = 0; c < width; ++c) {
      Keep(keep, b.history[c]);
    }
  }
  return overlaps;
}

void StoreLoads(const PairLanes& lanes, int b, const ContactBlock& block, GrainLoad* loads,
                LaneSums& sums) {
  const auto begin = static_cast<std::ptrdiff_t>(b) * kBlock;
  AddStress(block, sums);
  Leave({lanes.place_i.data() + begin, lanes.place_j.data() + begin}, block, loads);
}

void GatherPlaces(const int* place_row, const GrainLoad* loads, int begin, int end,
                  ParticleArrays& p) {
  Gather(place_row, loads, begin, end,
         {.force = {p.fx.data(), p.fy.data(), p.fz.data()},
          .torque = {p.tx.data(), p.ty.data(), p.tz.data()}});
}

}  // namespace calib::dem
