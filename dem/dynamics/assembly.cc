// What an assembly is made of: grains, model, walls, and the figures that follow from them.
#include "dem/dynamics/assembly.h"

#include <algorithm>
#include <cassert>
#include <numbers>
#include <utility>

#include "dem/elementary/functions.h"

namespace calib::dem {
namespace {

/// Gap up to which pairs are listed in a periodic cell, over the mean diameter [-]. Chosen: a wider
/// skin lists more pairs, a narrower one searches more often; the fastest on dense packings of 1000
/// to 10 000 grains, measured by hand.
constexpr double kSkin = 0.03;

Surroundings NoSurroundings() { return {.open = {false, false, false}, .skin = kSkin}; }

}  // namespace

Assembly::Assembly(const Packing& packing, double density, ContactModel model, int threads)
    : Assembly(packing, density, std::move(model), NoSurroundings(), threads) {}

Assembly::Assembly(const Packing& packing, double density, ContactModel model,
                   Surroundings surroundings, int threads)
    : particles_(MakeParticles(packing, density, surroundings.thickness)),
      model_(std::move(model)),
      threads_(threads),
      sliding_friction_(model_.sliding_friction()),
      gravity_(surroundings.gravity),
      density_(density),
      thickness_(surroundings.thickness),
      next_id_(particles_.size()),
      planar_(surroundings.planar),
      walls_(std::move(surroundings.walls)) {
  assert(particles_.size() > 0 && density > 0 && threads >= 1);
  std::copy(std::begin(packing.length), std::end(packing.length), std::begin(cell_.length));
  std::copy(std::begin(surroundings.open), std::end(surroundings.open), std::begin(cell_.open));
  if (model_.materials() != nullptr) {
    TakeMaterials(packing);
    walls_.SetMaterial(model_.materials()->IndexOf(surroundings.material));
  }
  clumps_ = RigidClumps(packing, ClumpMatterOf(density), particles_);
  assert(thickness_ == 0 || planar_);
  double radii = 0;
  for (std::size_t g = 0; g < particles_.radius.size(); ++g) {
    if (particles_.body.empty() || particles_.body[g] < 0) {
      solid_volume_ += InertiaOf(particles_.radius[g], 1, thickness_).mass;
      radii += particles_.radius[g];
      ++bodies_;
    }
  }
  for (const Clump& clump : clumps_.all()) {
    solid_volume_ += clump.volume;
    radii += CubeRoot(0.75 / std::numbers::pi * clump.volume);
    ++bodies_;
  }
  mean_diameter_ = 2 * radii / bodies_;
  largest_radius_ = *std::max_element(particles_.radius.begin(), particles_.radius.end());
  reach_ = model_.Reach(largest_radius_);
  skin_ = surroundings.skin * mean_diameter_ + reach_;
  wall_reach_ = walls_.empty() ? 0 : model_.Reach(2 * largest_radius_);
  SetNominalStep();
}

/// Masses of grains that are not of the model's own material. Precondition: no clumps.
void Assembly::TakeMaterials(const Packing& packing) {
  const Materials& materials = *model_.materials();
  ParticleArrays& p = particles_;
  p.material.assign(p.x.size(), 0);
  for (std::size_t g = 0; g < p.x.size() && !packing.material.empty(); ++g) {
    const int material = materials.IndexOf(packing.material[static_cast<std::size_t>(p.id[g])]);
    const Inertia inertia = InertiaOf(p.radius[g], DensityOf(material), thickness_);
    p.material[g] = static_cast<std::uint8_t>(material);
    p.inverse_mass[g] = 1.0 / inertia.mass;
    p.inverse_inertia[g] = 1.0 / inertia.moment;
  }
}

double Assembly::DensityOf(int material) const {
  return material == 0 ? density_ : model_.materials()->density(material);
}

void Assembly::Shrink(const std::vector<std::pair<int, double>>& radii) {
  assert(thickness_ == 0);
  for (const auto& [grain, radius] : radii) {
    const auto g = static_cast<std::size_t>(grain);
    assert(radius <= particles_.radius[g]);
    const double ratio = particles_.radius[g] / radius;
    particles_.radius[g] = radius;
    particles_.inverse_mass[g] *= ratio * ratio * ratio;
    particles_.inverse_inertia[g] *= ratio * ratio * ratio * ratio * ratio;
  }
  SetNominalStep();
  PackAllGrains();
}

}  // namespace calib::dem
