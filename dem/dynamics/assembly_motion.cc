// One leapfrog step of grains and cell under the loads that the contacts have left.
#include <algorithm>
#include <cassert>
#include <cmath>

#include "dem/contact/simd.h"
#include "dem/dynamics/assembly.h"
#include "dem/dynamics/chunks.h"

namespace calib::dem {
namespace {

/// Largest squared distance between centres and the affine image of where they were; NaN if there
/// is one.
CALIB_DEM_CLONES double LargestShift2(const ParticleArrays& p,
                                      const std::array<std::vector<double>, 3>& searched,
                                      const double* scale, double shear, std::size_t begin,
                                      std::size_t end) {
  constexpr std::size_t kLanes = 8;  // partial maxima: a vector register of doubles or two
  const double* const x = p.x.data();
  const double* const y = p.y.data();
  const double* const z = p.z.data();
  const double* const x0 = searched[0].data();
  const double* const y0 = searched[1].data();
  const double* const z0 = searched[2].data();
  double largest[kLanes] = {};
  const auto shift2 = [&](std::size_t g) {
    const double ux = x[g] - scale[0] * x0[g] - shear * z0[g];
    const double uy = y[g] - scale[1] * y0[g];
    const double uz = z[g] - scale[2] * z0[g];
    return ux * ux + uy * uy + uz * uz;
  };
  std::size_t g = begin;
  for (; g + kLanes <= end; g += kLanes) {
    for (std::size_t l = 0; l < kLanes; ++l) {
      const double u2 = shift2(g + l);
      largest[l] = u2 <= largest[l] ? largest[l] : u2;  // a NaN enters and stays
    }
  }
  double result = 0;
  for (; g < end; ++g) {
    const double u2 = shift2(g);
    result = u2 <= result ? result : u2;
  }
  for (const double l : largest) {
    result = l <= result ? result : l;
  }
  return result;
}

}  // namespace

void Assembly::AddSurroundings(int begin, int end) {
  ParticleArrays& p = particles_;
  if (!walls_.empty()) {
    walls_.AddLoads(begin, end, p);
  }
  const double g[3] = {gravity_.x, gravity_.y, gravity_.z};
  std::vector<double>* const force[3] = {&p.fx, &p.fy, &p.fz};
  for (std::size_t a = 0; a < 3; ++a) {
    if (g[a] != 0) {
      for (int k = begin; k < end; ++k) {
        const auto q = static_cast<std::size_t>(k);
        if (p.body.empty() || p.body[q] < 0) {  // clumps weigh once, at their centre of mass
          (*force[a])[q] += g[a] / p.inverse_mass[q];
        }
      }
    }
  }
  if (planar_) {
    for (auto* load : {&p.fy, &p.tx, &p.tz}) {
      std::fill(load->begin() + begin, load->begin() + end, 0.0);
    }
  }
}

void Assembly::MoveChunk(int chunk, const Motion& motion) {
  const auto begin = static_cast<std::size_t>(chunk) * kGrainChunk;
  const auto end = std::min(begin + kGrainChunk, particles_.x.size());
  places_.Gather(static_cast<int>(begin), static_cast<int>(end), particles_);
  AddSurroundings(static_cast<int>(begin), static_cast<int>(end));
  AdvanceGrains(motion, static_cast<int>(begin), static_cast<int>(end), particles_);
}

/// What the next evaluation needs of grains at their new places, while caches still hold them.
void Assembly::FinishChunk(int chunk) {
  PackChunk(chunk);
  shift2_[static_cast<std::size_t>(chunk)] = LargestShift2OfChunk(chunk);
}

double Assembly::LargestShift2OfChunk(int chunk) const {
  const auto begin = static_cast<std::size_t>(chunk) * kGrainChunk;
  const auto end = std::min(begin + kGrainChunk, particles_.x.size());
  double scale[3];
  for (int a = 0; a < 3; ++a) {
    scale[a] = cell_.length[a] / searched_length_[a];
  }
  return LargestShift2(particles_, searched_, scale, ShearSinceSearch(), begin, end);
}

void Assembly::Move(const Motion& motion) {
  assert(loads_fit_ || particles_.size() == 0);
  cell_.shear = motion.shear;
  cell_.displacement +=
      motion.dt * (motion.stretch[0] * cell_.displacement + motion.shear * cell_.length[2]);
  for (int a = 0; a < 3; ++a) {
    cell_.stretch[a] = motion.stretch[a];
    cell_.length[a] += motion.dt * motion.stretch[a] * cell_.length[a];
  }
  last_dt_ = motion.dt;
  const int chunks = ChunkCount(particles_.size(), kGrainChunk);
  shift2_.resize(static_cast<std::size_t>(chunks));
  ForEachChunk(chunks, threads_, [&](int chunk) {
    MoveChunk(chunk, motion);
    if (clumps_.empty()) {
      FinishChunk(chunk);
    }
  });
  if (!clumps_.empty()) {  // takes its members back from where they went alone
    clumps_.Advance(motion, gravity_, cell_, threads_, particles_);
    ForEachChunk(chunks, threads_, [&](int chunk) { FinishChunk(chunk); });
  }
  packed_ = true;
  double largest = 0;
  for (const double m : shift2_) {
    largest = m <= largest ? largest : m;
  }
  moved_ = std::sqrt(largest);
  walls_.Move(motion.dt);
  ++steps_;
}

}  // namespace calib::dem
