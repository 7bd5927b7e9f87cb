#include "dem/dynamics/contact_model.h"

#include <algorithm>
#include <cassert>
#include <map>
#include <string>
#include <utility>

#include "dem/contact/common_parameters.h"
#include "dem/contact/contact_kinematics.h"
#include "dem/contact/grain_mass.h"
#include "dem/contact/simd.h"
#include "dem/contact/sliding.h"
#include "dem/model/contact_law.h"

namespace calib::dem {
namespace {

/// What only effects set.
CALIB_DEM_CLONES void ClearExtras(ContactBlock& b) {
  for (int k = 0; k < kBlock; ++k) {
    b.attraction[k] = b.holds[k] = b.normal_damping[k] = b.tangential_damping[k] = 0.0;
    b.mx[k] = b.my[k] = b.mz[k] = b.rolling_stiffness[k] = b.twisting_stiffness[k] = 0.0;
  }
}

}  // namespace

ContactModel::ContactModel(const Model& model, const ModelEntries& entries, double thickness)
    : common_(CommonChainOf(model, entries, thickness)),
      sliding_friction_(SlidingFriction(model.parameters)) {
  std::vector<std::pair<ContactStage, std::shared_ptr<const ContactKernel>>> kernels;
  const ContactEntry& law = *entries.law;
  const ParameterSet law_parameters = ResolveParameters(law.info.parameters, "", model.parameters);
  if (!model.materials.empty()) {
    materials_ = std::make_shared<const Materials>(model, law.info, law_parameters, thickness);
  }
  const KernelContext law_context{.linear_springs = law.info.linear_springs,
                                  .density = model.density,
                                  .thickness = thickness,
                                  .law = law_parameters,
                                  .parameters = law_parameters,
                                  .materials = materials_.get()};
  kernels.emplace_back(ContactStage::kNormal, law.make(law_context));
  kernels.emplace_back(ContactStage::kSlidingLimit, MakeCoulombLimit());
  kernels.emplace_back(ContactStage::kTangential, MakeTangentialSpring(model.shear_unloading));
  const ContactKernel* const spring = kernels.back().second.get();
  WallProperties walls;
  for (const EffectEntry* effect : entries.effects) {
    const std::string& name = effect->info.name;
    const KernelContext context{
        .linear_springs = law.info.linear_springs,
        .effect = name,
        .density = model.density,
        .thickness = thickness,
        .law = law_parameters,
        .parameters = ResolveParameters(effect->info.parameters, name + ".", model.parameters),
        .materials = materials_.get()};
    if (effect->bound != nullptr) {
      effect->bound(context.parameters, walls);
    }
    for (const EffectKernel& kernel : effect->kernels) {
      kernels.emplace_back(kernel.stage, kernel.make(context));
    }
  }
  for (const UserEffect& effect : model.user_effects) {
    const std::string& name = effect.info.name;
    if (effect.info.kind != "contact" ||
        std::find(model.effects.begin(), model.effects.end(), name) == model.effects.end()) {
      continue;
    }
    if (stage_ == nullptr && NeedsStage(effect)) {
      stage_ = std::make_shared<StageState>();
    }
    formulas_.push_back(std::make_shared<FormulaKernel>(
        effect, ResolveParameters(effect.info.parameters, name + ".", model.parameters),
        GrainMassOf(model.density, thickness), stage_));
    kernels.emplace_back(StageOf(effect), formulas_.back());
  }
  wall_friction_ = walls.friction.value_or(walls.friction_ratio * sliding_friction_);
  if (law.make_dashpot != nullptr) {
    kernels.emplace_back(ContactStage::kNormalExtra, law.make_dashpot(law_context));
  }
  std::stable_sort(kernels.begin(), kernels.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  for (auto& [stage, kernel] : kernels) {
    const int size = kernel->HistorySize();
    if (kernel.get() == spring) {
      shear_history_ = history_size_;
    }
    chain_.push_back({.kernel = std::move(kernel), .first_history = history_size_});
    history_size_ += size;
  }
  assert(history_size_ <= kMaxHistory);
}

std::optional<ContactFault> ContactModel::Fault() const {
  for (const auto& formula : formulas_) {
    if (auto fault = formula->Fault()) {
      return fault;
    }
  }
  return std::nullopt;
}

double ContactModel::Reach(double largest_radius) const {
  double reach = 0;
  for (const Link& link : chain_) {
    reach = std::max(reach, link.kernel->Reach(largest_radius));
  }
  return reach;
}

double ContactModel::Stiffening() const {
  double factor = 1;
  for (const Link& link : chain_) {
    factor *= link.kernel->Stiffening();
  }
  return factor;
}

void ContactModel::Evaluate(ContactBlock& block) const {
  if (block.wall) {
    ComputeWallKinematics(block);
  } else {
    ComputeKinematics(block);
  }
  ClearExtras(block);
  if (materials_ != nullptr) {
    materials_->Complete(block);
  }
  for (const Link& link : chain_) {
    link.kernel->Apply(block, link.first_history);
  }
  ComputeTotals(block);
}

}  // namespace calib::dem
