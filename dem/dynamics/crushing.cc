#include "dem/dynamics/crushing.h"

#include <Random123/philox.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/elementary/functions.h"
#include "dem/particles/random_numbers.h"

namespace calib::dem {
namespace {

/// Diameter over the first one below which grains do not crush [-]. Chosen: smaller grains cost
/// steps and carry little.
constexpr double kComminutionLimit = 0.1;
/// Largest share of the pores that fines fill [-]: random close packing.
/// [Scott & Kilgour, J. Phys. D 2 (1969) 863]
constexpr double kDensestFines = 0.64;

double Volume(double radius) { return 4.0 / 3.0 * std::numbers::pi * radius * radius * radius; }

}  // namespace

Crushing::Crushing(const CrushingLaw& law, std::uint64_t seed, const Assembly& assembly)
    : law_(law),
      seed_(seed),
      first_radius_(assembly.particles().radius),
      radius_(first_radius_.size(), 0.0),
      strength_(first_radius_.size(), 0.0) {}

void Crushing::Refresh(std::size_t grain, const ParticleArrays& p) {
  if (radius_[grain] == p.radius[grain]) {
    return;
  }
  radius_[grain] = p.radius[grain];
  const double shrunk = Log(radius_[grain] / first_radius_[grain]);
  const auto times = static_cast<int>(std::lround(shrunk / Log1p(-law_.size_loss)));
  strength_[grain] = Strength(p.id[grain], times, 2 * radius_[grain]);
}

double Crushing::FinesVolume(const Assembly& assembly) const {
  double fines = 0;
  for (std::size_t g = 0; g < first_radius_.size(); ++g) {
    fines += Volume(first_radius_[g]) - Volume(assembly.particles().radius[g]);
  }
  return fines;
}

absl::Status Crushing::FinesFit(const Assembly& assembly) const {
  const double volume = assembly.cell().Volume();
  const double fines = FinesVolume(assembly);
  const double pores = volume - (assembly.solid_volume() - fines);
  if (fines <= kDensestFines * std::max(0.0, pores)) {
    return absl::OkStatus();
  }
  return absl::OutOfRangeError(absl::StrCat(
      "the fines of particle_crushing no longer fit between the grains: they are ", fines / volume,
      " of the volume, the pores ", pores / volume, ", of which they can fill ", kDensestFines,
      " without carrying load (porosity with fines ", 1.0 - assembly.solid_volume() / volume,
      "); weakness or size_loss is too large for the stress"));
}

double Crushing::Strength(int id, int times, double diameter) const {
  const r123::Philox4x32::key_type key = {
      {static_cast<std::uint32_t>(seed_), static_cast<std::uint32_t>(seed_ >> 32)}};
  const auto bits = r123::Philox4x32()(
      {{kCrushingDraw, static_cast<std::uint32_t>(id), static_cast<std::uint32_t>(times), 0}}, key);
  const double u = (bits[0] + 0.5) / 4294967296.0;
  const double size = law_.reference_diameter / diameter;
  return Pow(size * size * size * -Log1p(-u), 1.0 / law_.weibull_modulus) / law_.weakness;
}

int Crushing::Crush(Assembly& assembly) {
  const ParticleArrays& p = assembly.particles();
  const NeighborList& list = assembly.neighbors();
  std::vector<double> largest2(p.x.size(), 0.0);  // square of the largest contact force
  for (int s = 0; s < list.size(); ++s) {
    if (!assembly.touching(s)) {
      continue;
    }
    const Vec3 f = assembly.force_on_j(s);
    const double force2 = f.x * f.x + f.y * f.y + f.z * f.z;
    const auto slot = static_cast<std::size_t>(s);
    for (const int g : {list.first[slot], list.second[slot]}) {
      double& largest = largest2[static_cast<std::size_t>(g)];
      largest = std::max(largest, force2);
    }
  }
  std::vector<std::pair<int, double>> shrunk;
  for (std::size_t g = 0; g < largest2.size(); ++g) {
    if (largest2[g] == 0) {
      continue;
    }
    Refresh(g, p);
    const double diameter = 2 * p.radius[g];
    const double smaller = (1.0 - law_.size_loss) * p.radius[g];
    if (std::sqrt(largest2[g]) >= strength_[g] * diameter * diameter &&
        smaller >= kComminutionLimit * first_radius_[g]) {
      shrunk.emplace_back(static_cast<int>(g), smaller);
    }
  }
  if (!shrunk.empty()) {
    assembly.Shrink(shrunk);
  }
  return static_cast<int>(shrunk.size());
}

}  // namespace calib::dem
