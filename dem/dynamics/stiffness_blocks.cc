#include "dem/dynamics/stiffness_blocks.h"

#include <algorithm>

#include "dem/contact/quad.h"
#include "dem/contact/simd.h"

namespace calib::dem {
namespace {

constexpr int kQuad = 4;  ///< doubles of a Quad

/// Stiffnesses or damping coefficients of the lanes; those of moments may be zero.
struct Coefficients {
  const double* normal;
  const double* more;  ///< what `normal` may grow by
  const double* tangential;
  const double* rolling;
  const double* twisting;
};

struct LanePlaces {
  const std::uint16_t* i;
  const std::uint16_t* j;
};

CALIB_DEM_INLINE void AddTo(const Quad& value, double* to) {
  Quad sum;
  LoadQuad(to, sum);
  sum += value;
  StoreQuad(sum, to);
}

/// One row of OwnStiffness at the places of four lanes.
CALIB_DEM_INLINE void AddRow(const Quad& a, const Quad& b, const Quad& c, const Quad& d,
                             const std::uint16_t* place, double (OwnStiffness::*part)[4],
                             OwnStiffness* to) {
  Quad row[4] = {a, b, c, d};
  Transpose(row);
  for (int l = 0; l < kQuad; ++l) {
    AddTo(row[l], to[place[l]].*part);
  }
}

/// Four contacts.
struct FourContacts {
  Quad n[3];        ///< normal
  Quad along[3];    ///< n n of xx, yy, zz; zero where a lane does not count
  Quad across[3];   ///< 1 - n n; likewise
  Quad both[3];     ///< n n of xy, yz, zx; likewise
  Quad normal;      ///< coefficient, with what it may grow by
  Quad tangential;  ///< likewise
  Quad rolling;
  Quad twisting;
};

/// What they do to the grains at `place`, of radius r, on whose side their normals point away times
/// `away` (1 or -1); share: 1 + t of dem/dynamics/stable_step.
CALIB_DEM_INLINE void AddSide(const FourContacts& c, const Quad& r, const Quad& away,
                              const Quad& share, const std::uint16_t* place, OwnStiffness* to) {
  const Quad none = {0, 0, 0, 0};
  const Quad shear = c.tangential * r * r;
  Quad translation[3];
  Quad rotation[3];
  Quad moment[3];
  Quad off[3];
  Quad turn_off[3];
  Quad couple[3];
  for (int a = 0; a < 3; ++a) {
    translation[a] = c.normal * c.along[a] + c.tangential * c.across[a];
    moment[a] = c.rolling * c.across[a] + c.twisting * c.along[a];
    rotation[a] = c.tangential * c.across[a] * r * r + moment[a];
    off[a] = share * (c.normal - c.tangential) * c.both[a];
    turn_off[a] = share * (c.twisting - c.rolling - shear) * c.both[a];
    couple[a] = away * share * c.tangential * r * (c.along[a] + c.across[a]) * c.n[a];
  }
  AddRow(translation[0], translation[1], translation[2], none, place, &OwnStiffness::translation,
         to);
  AddRow(rotation[0], rotation[1], rotation[2], none, place, &OwnStiffness::rotation, to);
  AddRow(moment[0], moment[1], moment[2], none, place, &OwnStiffness::moment, to);
  AddRow(share * translation[0], share * translation[1], share * translation[2], couple[0], place,
         &OwnStiffness::shared, to);
  AddRow(off[0], off[1], off[2], couple[1], place, &OwnStiffness::shared_off, to);
  AddRow(share * rotation[0], share * rotation[1], share * rotation[2], couple[2], place,
         &OwnStiffness::shared_turn, to);
  AddRow(turn_off[0], turn_off[1], turn_off[2], none, place, &OwnStiffness::shared_turn_off, to);
}

/// Of a contact with normal n, against translation: c_n n n' + c_s (1 - n n'); against rotation:
/// (c_s r^2 + c_r)(1 - n n') + c_t n n'; the couple: c_s r n. keep: above zero where a lane counts.
/// along: adds translation times squared branch of each axis, in four sums, without what the
/// contact may stiffen by.
CALIB_DEM_CLONES void AddTerms(const LanePlaces place, const Coefficients c, const ContactBlock& b,
                               const double* keep, OwnStiffness* to, double (*along)[kQuad]) {
  const Quad zero = {0, 0, 0, 0};
  const Quad one = {1, 1, 1, 1};
  const double* const n[3] = {b.nx, b.ny, b.nz};
  const double* const d[3] = {b.dx, b.dy, b.dz};
  Quad sum[3];
  for (int a = 0; a < 3; ++a) {
    LoadQuad(along[a], sum[a]);
  }
  for (int k = 0; k < kBlock; k += kQuad) {
    FourContacts four;
    Quad on;
    Quad normal;
    Quad more;
    Quad tangential;
    Quad rolling;
    Quad twisting;
    Quad ri;
    Quad rj;
    LoadQuad(keep + k, on);
    LoadQuad(c.normal + k, normal);
    LoadQuad(c.more + k, more);
    LoadQuad(c.tangential + k, tangential);
    LoadQuad(c.rolling + k, rolling);
    LoadQuad(c.twisting + k, twisting);
    LoadQuad(b.radius_i + k, ri);
    LoadQuad(b.radius_j + k, rj);
    normal = on > zero ? normal : zero;  // what does not touch may hold anything
    four.normal = on > zero ? normal + more : zero;
    four.tangential = on > zero ? tangential : zero;
    four.rolling = on > zero ? rolling : zero;
    four.twisting = on > zero ? twisting : zero;
    for (int a = 0; a < 3; ++a) {
      LoadQuad(n[a] + k, four.n[a]);
    }
    for (int a = 0; a < 3; ++a) {
      Quad branch;
      LoadQuad(d[a] + k, branch);
      const Quad n2 = four.n[a] * four.n[a];
      four.along[a] = on > zero ? n2 : zero;
      four.across[a] = on > zero ? one - n2 : zero;
      four.both[a] = on > zero ? four.n[a] * four.n[(a + 1) % 3] : zero;
      sum[a] += (normal * four.along[a] + four.tangential * four.across[a]) * branch * branch;
    }
    const Quad ratio = on > zero ? ri * ri * ri / (rj * rj * rj) : one;
    AddSide(four, ri, one, one + ratio, place.i + k, to);
    AddSide(four, rj, -one, one + one / ratio, place.j + k, to);
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

void AddAll(const LanePlaces place, const Coefficients& c, const ContactBlock& b,
            const double* keep, int places, std::vector<OwnStiffness>& to,
            std::array<double, 3>& along) {
  to.resize(static_cast<std::size_t>(places), OwnStiffness{});
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
  AddAll(place,
         {block.normal_stiffness, block.may_stiffen, block.tangential_stiffness,
          block.rolling_stiffness, block.twisting_stiffness},
         block, keep, places, chunk.spring, chunk.modulus);
  if (SumOf(block.normal_damping, keep) + SumOf(block.tangential_damping, keep) > 0) {
    AddAll(place, {block.normal_damping, kNone, block.tangential_damping, kNone, kNone}, block,
           keep, places, chunk.dashpot, chunk.viscosity);
  }
  const double rolling = SumOf(block.rolling_stiffness, keep);
  const double twisting = SumOf(block.twisting_stiffness, keep);
  if (rolling + twisting > 0) {
    chunk.rolling += rolling;
    chunk.twisting += twisting;
  }
}

}  // namespace calib::dem
