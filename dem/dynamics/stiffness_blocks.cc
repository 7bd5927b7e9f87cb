#include "dem/dynamics/stiffness_blocks.h"

#include <algorithm>

#include "dem/contact/quad.h"
#include "dem/contact/simd.h"

namespace calib::dem {
namespace {

constexpr int kQuad = 4;

/// Stiffnesses or damping coefficients of the lanes; those of moments may be zero.
struct Coefficients {
  const double* normal;
  const double* tangential;
  const double* rolling;
  const double* twisting;
};

struct LanePlaces {
  const std::uint16_t* i;
  const std::uint16_t* j;
};

CALIB_DEM_INLINE void AddRow(const Quad& translation, const Quad& rotation, GrainLoad& to) {
  Quad t;
  Quad r;
  LoadQuad(to.force, t);
  LoadQuad(to.torque, r);
  t += translation;
  r += rotation;
  StoreQuad(t, to.force);
  StoreQuad(r, to.torque);
}

/// Of a contact with normal n along axis a, against translation: c_n n_a^2 + c_s (1 - n_a^2);
/// against rotation: (c_s r^2 + c_r)(1 - n_a^2) + c_t n_a^2. keep: above zero where a lane counts.
/// along: adds translation times squared branch of each axis, in four sums.
CALIB_DEM_CLONES void AddTerms(const LanePlaces place, const Coefficients c, const ContactBlock& b,
                               const double* keep, GrainLoad* to, double (*along)[kQuad]) {
  const Quad zero = {0, 0, 0, 0};
  const Quad one = {1, 1, 1, 1};
  const double* const n[3] = {b.nx, b.ny, b.nz};
  const double* const d[3] = {b.dx, b.dy, b.dz};
  Quad sum[3];
  for (int a = 0; a < 3; ++a) {
    LoadQuad(along[a], sum[a]);
  }
  for (int k = 0; k < kBlock; k += kQuad) {
    Quad on;
    Quad normal;
    Quad tangential;
    Quad rolling;
    Quad twisting;
    Quad ri;
    Quad rj;
    LoadQuad(keep + k, on);
    LoadQuad(c.normal + k, normal);
    LoadQuad(c.tangential + k, tangential);
    LoadQuad(c.rolling + k, rolling);
    LoadQuad(c.twisting + k, twisting);
    LoadQuad(b.radius_i + k, ri);
    LoadQuad(b.radius_j + k, rj);
    Quad translation[4];
    Quad rotation_i[4];
    Quad rotation_j[4];
    for (int a = 0; a < 3; ++a) {
      Quad component;
      Quad branch;
      LoadQuad(n[a] + k, component);
      LoadQuad(d[a] + k, branch);
      const Quad n2 = component * component;
      const Quad across = one - n2;
      const Quad moment = rolling * across + twisting * n2;
      translation[a] = on > zero ? normal * n2 + tangential * across : zero;
      rotation_i[a] = on > zero ? tangential * across * ri * ri + moment : zero;
      rotation_j[a] = on > zero ? tangential * across * rj * rj + moment : zero;
      sum[a] += translation[a] * branch * branch;
    }
    translation[3] = rotation_i[3] = rotation_j[3] = zero;
    Transpose(translation);
    Transpose(rotation_i);
    Transpose(rotation_j);
    for (int l = 0; l < kQuad; ++l) {
      AddRow(translation[l], rotation_i[l], to[place.i[k + l]]);
      AddRow(translation[l], rotation_j[l], to[place.j[k + l]]);
    }
  }
  for (int a = 0; a < 3; ++a) {
    StoreQuad(sum[a], along[a]);
  }
}

/// The sum of a quantity over the lanes that count.
CALIB_DEM_CLONES double SumOf(const double* lane, const double* keep) {
  const Quad zero = {0, 0, 0, 0};
  Quad sum = zero;
  for (int k = 0; k < kBlock; k += kQuad) {
    Quad on;
    Quad value;
    LoadQuad(keep + k, on);
    LoadQuad(lane + k, value);
    sum += on > zero ? value : zero;
  }
  return sum[0] + sum[1] + sum[2] + sum[3];
}

/// keep: one where the lane touches, else zero. Returns whether one of them is too deep.
CALIB_DEM_CLONES bool Look(const ContactBlock& b, const std::uint8_t* touching, double* keep) {
  int deep = 0;
  for (int k = 0; k < kBlock; ++k) {
    const int on = touching[k] != 0 ? 1 : 0;
    const double smaller = b.radius_i[k] < b.radius_j[k] ? b.radius_i[k] : b.radius_j[k];
    deep |= on & (b.overlap[k] <= 0.5 * smaller ? 0 : 1);  // NaN is too deep
    keep[k] = on;
  }
  return deep != 0;
}

void AddTo(const LanePlaces place, const Coefficients& c, const ContactBlock& b, const double* keep,
           int places, std::vector<GrainLoad>& to, std::array<double, 3>& along) {
  to.resize(static_cast<std::size_t>(places), GrainLoad{});
  alignas(32) double sums[3][kQuad] = {};
  AddTerms(place, c, b, keep, to.data(), sums);
  for (std::size_t a = 0; a < 3; ++a) {
    along[a] += sums[a][0] + sums[a][1] + sums[a][2] + sums[a][3];
  }
}

}  // namespace

void AddStiffness(const PairLanes& lanes, int b, const ContactBlock& block,
                  const std::uint8_t* touching, int places, ChunkStiffness& chunk) {
  alignas(64) static constexpr ContactBlock::Lane kNone = {};
  alignas(64) double keep[kBlock];
  if (Look(block, touching, keep) && chunk.too_deep < 0) {
    int k = 0;
    while (keep[k] == 0 ||
           block.overlap[k] <= 0.5 * std::min(block.radius_i[k], block.radius_j[k])) {
      ++k;
    }
    chunk.too_deep = b * kBlock + k;
    chunk.deepest_there = block.overlap[k];
  }
  const auto begin = static_cast<std::ptrdiff_t>(b) * kBlock;
  const LanePlaces place = {lanes.place_i.data() + begin, lanes.place_j.data() + begin};
  AddTo(place,
        {block.normal_stiffness, block.tangential_stiffness, block.rolling_stiffness,
         block.twisting_stiffness},
        block, keep, places, chunk.spring, chunk.modulus);
  if (SumOf(block.normal_damping, keep) + SumOf(block.tangential_damping, keep) > 0) {
    AddTo(place, {block.normal_damping, block.tangential_damping, kNone, kNone}, block, keep,
          places, chunk.dashpot, chunk.viscosity);
  }
  const double rolling = SumOf(block.rolling_stiffness, keep);
  const double twisting = SumOf(block.twisting_stiffness, keep);
  if (rolling + twisting > 0) {
    chunk.rolling += rolling;
    chunk.twisting += twisting;
    std::array<double, 3> nothing{};
    AddTo(place, {kNone, kNone, block.rolling_stiffness, block.twisting_stiffness}, block, keep,
          places, chunk.moment, nothing);
  }
}

}  // namespace calib::dem
