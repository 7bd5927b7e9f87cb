// Contact forces of the present configuration: which listed pairs touch, and blocks of them through
// the chain of kernels.
#include <algorithm>

#include "absl/strings/str_cat.h"
#include "dem/dynamics/assembly.h"
#include "dem/dynamics/chunks.h"

namespace calib::dem {
namespace {

/// What deciding on contact needs of pairs and grains.
struct PairInput {
  const int* first;
  const int* second;
  const std::uint8_t* image;
  const double* x;
  const double* y;
  const double* z;
  const double* radius;
  const std::array<double, 3>* shift;
  double reach;  ///< 0, or the gap up to which contacts act
};

/// depth: (r_i + r_j + reach)^2 - |d|^2 of each pair [m^2]; positive: within reach, or touching.
void MeasureDistances(const PairInput& in, std::size_t begin, std::size_t end, double* depth) {
  for (std::size_t s = begin; s < end; ++s) {
    const int i = in.first[s];
    const int j = in.second[s];
    const double* const shift = in.shift[in.image[s]].data();
    const double dx = in.x[j] + shift[0] - in.x[i];
    const double dy = in.y[j] + shift[1] - in.y[i];
    const double dz = in.z[j] + shift[2] - in.z[i];
    const double reach = in.radius[i] + in.radius[j] + in.reach;
    depth[s - begin] = reach * reach - (dx * dx + dy * dy + dz * dz);
  }
}

}  // namespace

absl::Status Assembly::EvaluateForces() {
  if (stale_ || list_.row.empty() || ListMayMissPairs()) {
    if (auto s = SearchNeighbors(); !s.ok()) {
      return s;
    }
  }
  for (int code = 0; code < kImages; ++code) {
    const int s[3] = {code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1};
    for (std::size_t a = 0; a < 3; ++a) {
      shift_[static_cast<std::size_t>(code)][a] = s[a] * cell_.length[a];
    }
    shift_[static_cast<std::size_t>(code)][0] += s[2] * cell_.Tilt();
  }
  ForEachChunk(static_cast<int>(sums_.size()), threads_,
               [this](int chunk) { EvaluateChunk(chunk); });
  if (auto s = FormulasFinite(); !s.ok()) {
    return s;
  }
  stress_ = {0, 0, 0};
  shear_stress_ = 0;
  contacts_ = 0;
  const double volume = cell_.Volume();
  for (const ChunkSums& sums : sums_) {
    contacts_ += sums.contacts;
    shear_stress_ -= sums.shear;
    for (std::size_t a = 0; a < 3; ++a) {
      stress_[a] += sums.stress[a];
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
    if (auto s = walls_.Evaluate(
            particles_, model_,
            {.dt = last_dt_, .viscous = viscous_, .reach = reach_, .threads = threads_});
        !s.ok()) {
      return s;
    }
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
    for (std::size_t s = 0; s < clump.members.size(); ++s) {
      const auto member = static_cast<std::size_t>(clump.members[s]);
      double force[3] = {0, 0, 0};
      for (int k = list_.place_row[member]; k < list_.place_row[member + 1]; ++k) {
        for (int a = 0; a < 3; ++a) {
          force[a] += loads_[static_cast<std::size_t>(k)].force[a];
        }
      }
      const std::array<double, 3>& arm = clump.arm[s];
      for (std::size_t a = 0; a < 3; ++a) {
        stress_[a] -= force[a] * arm[a] / volume;
      }
      shear_stress_ += 0.5 * (force[0] * arm[2] + force[2] * arm[0]) / volume;
    }
  }
}

void Assembly::LoadLane(int slot, ContactBlock& b) const {
  const int k = b.count++;
  const ParticleArrays& p = particles_;
  const int i = list_.first.data()[slot];
  const int j = list_.second.data()[slot];
  const std::array<double, 3>& shift = shift_[list_.image.data()[slot]];
  b.pair[k] = slot;
  b.dx[k] = p.x.data()[j] + shift[0] - p.x.data()[i];
  b.dy[k] = p.y.data()[j] + shift[1] - p.y.data()[i];
  b.dz[k] = p.z.data()[j] + shift[2] - p.z.data()[i];
  b.radius_i[k] = p.radius.data()[i];
  b.radius_j[k] = p.radius.data()[j];
  b.vx[k] = p.vx.data()[j] - p.vx.data()[i];
  b.vy[k] = p.vy.data()[j] - p.vy.data()[i];
  b.vz[k] = p.vz.data()[j] - p.vz.data()[i];
  b.wix[k] = p.wx.data()[i];
  b.wiy[k] = p.wy.data()[i];
  b.wiz[k] = p.wz.data()[i];
  b.wjx[k] = p.wx.data()[j];
  b.wjy[k] = p.wy.data()[j];
  b.wjz[k] = p.wz.data()[j];
  const int width = model_.history_size();
  const double* const remembered = history_.data() + static_cast<std::ptrdiff_t>(slot) * width;
  for (int c = 0; c < width; ++c) {
    b.history[c][k] = remembered[c];
  }
}

void Assembly::OpenContact(std::size_t slot) {
  const auto width = static_cast<std::size_t>(model_.history_size());
  touching_[slot] = 0;
  loads_[static_cast<std::size_t>(list_.place_i[slot])] = GrainLoad{};
  loads_[static_cast<std::size_t>(list_.place_j[slot])] = GrainLoad{};
  std::fill_n(history_.begin() + static_cast<std::ptrdiff_t>(slot * width), width, 0.0);
}

int Assembly::CollectActive(std::size_t begin, std::size_t end, int* active) {
  PairInput input{.first = list_.first.data(),
                  .second = list_.second.data(),
                  .image = list_.image.data(),
                  .x = particles_.x.data(),
                  .y = particles_.y.data(),
                  .z = particles_.z.data(),
                  .radius = particles_.radius.data(),
                  .shift = shift_.data(),
                  .reach = 0};
  double depth[kPairChunk];
  MeasureDistances(input, begin, end, depth);
  if (reach_ > 0) {  // formed contacts go on as far as a kernel may hold them
    double within[kPairChunk];
    input.reach = reach_;
    MeasureDistances(input, begin, end, within);
    for (std::size_t s = begin; s < end; ++s) {
      depth[s - begin] = touching_[s] != 0 ? within[s - begin] : depth[s - begin];
    }
  }
  int count = 0;
  for (std::size_t s = begin; s < end;
       ++s) {  // without branches: which pairs touch cannot be predicted
    const bool touches = depth[s - begin] > 0;
    active[count] = static_cast<int>(s);
    count += touches ? 1 : 0;
    if (touching_.data()[s] > static_cast<std::uint8_t>(touches)) {
      OpenContact(s);
    }
  }
  return count;
}

void Assembly::EvaluateChunk(int chunk) {
  const auto begin = static_cast<std::size_t>(chunk) * kPairChunk;
  const auto end = std::min(begin + kPairChunk, list_.second.size());
  int active[kPairChunk];
  const int count = CollectActive(begin, end, active);
  ContactBlock block;
  block.dt = last_dt_;
  block.sliding_friction = sliding_friction_;
  block.viscous = viscous_ ? 1.0 : 0.0;
  std::copy(std::begin(cell_.stretch), std::end(cell_.stretch), std::begin(block.stretch));
  block.shear = cell_.shear;
  ChunkSums sums;
  for (int a = 0; a < count; ++a) {
    LoadLane(active[a], block);
    if (block.count == kBlock) {
      StoreBlock(block, sums);
    }
  }
  if (block.count > 0) {
    PadLanes(model_.history_size(), block);
    StoreBlock(block, sums);
  }
  sums_[static_cast<std::size_t>(chunk)] = sums;
}

void Assembly::StoreBlock(ContactBlock& b, ChunkSums& sums) {
  model_.Evaluate(b);
  const int width = model_.history_size();
  for (int k = 0; k < b.count; ++k) {
    const int slot = b.pair[k];
    const bool overlaps = b.overlap[k] > 0;
    if (reach_ > 0 && !overlaps && !(b.holds[k] > 0)) {
      OpenContact(static_cast<std::size_t>(slot));
      continue;
    }
    const double fx = b.force_x[k];
    const double fy = b.force_y[k];
    const double fz = b.force_z[k];
    loads_.data()[list_.place_i.data()[slot]] = {{-fx, -fy, -fz},
                                                 {b.torque_ix[k], b.torque_iy[k], b.torque_iz[k]}};
    loads_.data()[list_.place_j.data()[slot]] = {{fx, fy, fz},
                                                 {b.torque_jx[k], b.torque_jy[k], b.torque_jz[k]}};
    sums.stress[0] += fx * b.dx[k];
    sums.stress[1] += fy * b.dy[k];
    sums.stress[2] += fz * b.dz[k];
    sums.shear += 0.5 * (fx * b.dz[k] + fz * b.dx[k]);
    sums.contacts += reach_ > 0 && !overlaps ? 0 : 1;
    touching_.data()[slot] = 1;
    double* const remembered = history_.data() + static_cast<std::ptrdiff_t>(slot) * width;
    for (int c = 0; c < width; ++c) {
      remembered[c] = b.history[c][k];
    }
  }
  b.count = 0;
}

}  // namespace calib::dem
