// Contact forces of the present configuration: which listed pairs touch, and blocks of them through
// the chain of kernels.
#include <algorithm>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "dem/dynamics/assembly.h"
#include "dem/dynamics/chunks.h"

namespace calib::dem {
absl::Status Assembly::EvaluateForces() {
  if (stale_ || list_.row.empty() || ListMayMissPairs()) {
    RETURN_IF_ERROR(SearchNeighbors());
  }
  loads_fit_ = true;
  SetShifts();
  if (!packed_) {
    PackAllGrains();
  }
  packed_ = false;  // who drives grains by hand may move them after this
  ForEachChunk(static_cast<int>(sums_.size()), threads_,
               [this](int chunk) { EvaluateChunk(chunk); });
  RETURN_IF_ERROR(FormulasFinite());
  stress_ = {0, 0, 0};
  shear_stress_ = 0;
  contacts_ = 0;
  const double volume = cell_.Volume();
  for (const ChunkSums& sums : sums_) {
    contacts_ += sums.contacts;
    for (std::size_t l = 0; l < 4; ++l) {
      shear_stress_ -= 0.5 * sums.lanes.at[3][l];
      for (std::size_t a = 0; a < 3; ++a) {
        stress_[a] += sums.lanes.at[a][l];
      }
    }
  }
  for (double& s : stress_) {
    s /= volume;
  }
  shear_stress_ /= volume;
  if (!clumps_.empty()) {
    TakeBranchesBetweenBodies();
  }
  contact_updates_ += contacts_;
  if (!walls_.empty()) {
    const WallContacts::Step step{.dt = last_dt_,
                                  .viscous = viscous_,
                                  .reach = wall_reach_,
                                  .moved = moved_,
                                  .threads = threads_};
    RETURN_IF_ERROR(walls_.Evaluate(particles_, model_, step));
    contact_updates_ += walls_.contacts();
    return FormulasFinite();
  }
  return absl::OkStatus();
}

absl::Status Assembly::FormulasFinite() const {
  const auto fault = model_.Fault();
  if (!fault) {
    return absl::OkStatus();
  }
  const auto at = static_cast<std::size_t>(fault->pair);
  const auto id = [this](int grain) { return particles_.id[static_cast<std::size_t>(grain)]; };
  return absl::OutOfRangeError(
      fault->wall ? absl::StrCat("grain ", id(fault->pair), " at a wall: ", fault->what)
                  : absl::StrCat("grains ", id(list_.first[at]), " and ", id(list_.second[at]),
                                 ": ", fault->what));
}

/// The stress of a rigid body is carried between centres of bodies: sum f d over contacts of
/// spheres less what the loads of the members do on their arms.
void Assembly::TakeBranchesBetweenBodies() {
  const double volume = cell_.Volume();
  for (const Clump& clump : clumps_.all()) {
    const int* const members = clump.members.data();
    const std::array<double, 3>* const arms = clump.arm.data();
    for (std::size_t s = 0; s < clump.members.size(); ++s) {
      const Vec3 force = places_.ForceOn(members[s]);
      const std::array<double, 3>& arm = arms[s];
      stress_[0] -= force.x * arm[0] / volume;
      stress_[1] -= force.y * arm[1] / volume;
      stress_[2] -= force.z * arm[2] / volume;
      shear_stress_ += 0.5 * (force.x * arm[2] + force.z * arm[0]) / volume;
    }
  }
}

void Assembly::SetShifts() {
  for (int code = 0; code < kImages; ++code) {
    const int s[3] = {code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1};
    for (int a = 0; a < 3; ++a) {
      shift_[code][a] = s[a] * cell_.length[a];
    }
    shift_[code][0] += s[2] * cell_.Tilt();
  }
}

void Assembly::PackAllGrains() {
  records_.resize(particles_.x.size());
  ForEachChunk(ChunkCount(particles_.size(), kGrainChunk), threads_,
               [this](int chunk) { PackChunk(chunk); });
}

void Assembly::PackChunk(int chunk) {
  const int begin = chunk * kGrainChunk;
  PackGrains(particles_, begin, std::min(begin + kGrainChunk, particles_.size()), records_.data());
}

bool Assembly::AnyTouching(int b) const {
  static constexpr std::uint8_t kNone[kBlock] = {};
  return std::memcmp(touching_.data() + static_cast<std::ptrdiff_t>(b) * kBlock, kNone, kBlock) !=
         0;
}

/// What all blocks of an evaluation have in common.
void Assembly::PrepareBlock(ContactBlock& block) const {
  block.dt = last_dt_;
  block.sliding_friction = sliding_friction_;
  block.viscous = viscous_ ? 1.0 : 0.0;
  std::copy(std::begin(cell_.stretch), std::end(cell_.stretch), std::begin(block.stretch));
  block.shear = cell_.shear;
}

/// Which materials meet in the lanes of block b, where the model has several.
void Assembly::LoadMaterials(int b, ContactBlock& block) const {
  const Materials* materials = model_.materials();
  if (materials == nullptr) {
    return;
  }
  block.mixed = true;
  const std::size_t first = static_cast<std::size_t>(b) * kBlock;
  for (std::size_t k = 0; k < kBlock; ++k) {
    block.materials[k] =
        materials->Pair(MaterialOf(static_cast<std::size_t>(lanes_.first[first + k])),
                        MaterialOf(static_cast<std::size_t>(lanes_.second[first + k])));
  }
}

void Assembly::EvaluateChunk(int chunk) {
  constexpr int kBlocks = kPairChunk / kBlock;
  ContactBlock block;
  PrepareBlock(block);
  ChunkSums sums;
  GrainLoad* const loads = places_.Clear(chunk);
  const int end = std::min((chunk + 1) * kBlocks, lanes_.blocks());
  for (int b = chunk * kBlocks; b < end; ++b) {
    if (!LoadBranches(lanes_, b, records_.data(), shift_, block) && !AnyTouching(b)) {
      continue;
    }
    LoadGrains(lanes_, b, records_.data(), block);
    if (!history_.empty()) {
      block.history = &history_[ColumnsOf(static_cast<std::size_t>(b))].lane;
    }
    block.count = std::min(kBlock, list_.size() - b * kBlock);
    std::uint8_t* const touching = touching_.data() + static_cast<std::ptrdiff_t>(b) * kBlock;
    if (model_.common()) {
      sums.contacts += EvaluateCommonChain(*model_.common(), block, touching);
    } else {
      for (int k = 0; k < block.count; ++k) block.pair[k] = b * kBlock + k;
      LoadMaterials(b, block);
      model_.Evaluate(block);
      sums.contacts += CloseBlock(block.count, reach_, model_.history_size(), block, touching);
    }
    AddLoads(lanes_, b, block, loads, forces_[static_cast<std::size_t>(b)], sums.lanes);
  }
  sums_[static_cast<std::size_t>(chunk)] = sums;
}

}  // namespace calib::dem
