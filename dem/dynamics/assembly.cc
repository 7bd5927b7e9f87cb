#include "dem/dynamics/assembly.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/contact/simd.h"
#include "dem/dynamics/chunks.h"

namespace calib::dem {
namespace {

/// Gap up to which pairs are listed, over the mean diameter: a wider skin lists more pairs, a
/// narrower one searches more often. Measured best on dense packings of 1000 to 10 000 grains.
constexpr double kSkin = 0.03;

/// Largest rate that the explicit step must follow, of an oscillator with a dashpot: the root of
/// (w/r)^2 + 2 (c/m)/r = 1, since forces use velocities half a step old; w without a dashpot.
/// w = sqrt(K/m) [1/s], damping c/m [1/s]
double DampedRate(double w, double damping) {
  return damping > 0 ? damping + std::sqrt(damping * damping + w * w) : w;
}

/// sqrt(m/K) of the smallest grain, held by one like it at an overlap of 1e-4 radii.
double NominalStep(const ContactModel& model, const ParticleArrays& p) {
  const auto smallest = static_cast<std::size_t>(
      std::min_element(p.radius.begin(), p.radius.end()) - p.radius.begin());
  ContactBlock block{};
  for (int k = 0; k < kBlock; ++k) {
    block.radius_i[k] = block.radius_j[k] = p.radius[smallest];
    block.dx[k] = (2.0 - 1e-4) * p.radius[smallest];
  }
  model.Evaluate(block);
  const double translation =
      (block.normal_stiffness[0] + block.tangential_stiffness[0]) * p.inverse_mass[smallest];
  const double rotation = (block.tangential_stiffness[0] * p.radius[smallest] * p.radius[smallest] +
                           block.rolling_stiffness[0] + block.twisting_stiffness[0]) *
                          p.inverse_inertia[smallest];
  const double slowest = std::sqrt(std::max(translation, rotation));
  const double damping =
      (block.normal_damping[0] + block.tangential_damping[0]) * p.inverse_mass[smallest];
  return 1.0 / DampedRate(slowest, damping);
}

/// Repeats lane 0 in the unused lanes, so that kernels meet valid numbers everywhere.
void PadLanes(int width, ContactBlock& b) {
  for (ContactBlock::Lane* lane : {&b.dx, &b.dy, &b.dz, &b.radius_i, &b.radius_j, &b.vx, &b.vy,
                                   &b.vz, &b.wix, &b.wiy, &b.wiz, &b.wjx, &b.wjy, &b.wjz}) {
    std::fill(*lane + b.count, *lane + kBlock, (*lane)[0]);
  }
  for (int c = 0; c < width; ++c) {
    std::fill(b.history[c] + b.count, b.history[c] + kBlock, b.history[c][0]);
  }
}

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

/// Largest squared distance between centres and the affine image of where they were; NaN if there
/// is one.
CALIB_DEM_CLONES double LargestShift2(const ParticleArrays& p,
                                      const std::array<std::vector<double>, 3>& searched,
                                      const double* scale, std::size_t begin, std::size_t end) {
  constexpr std::size_t kLanes = 8;
  const double* const x = p.x.data();
  const double* const y = p.y.data();
  const double* const z = p.z.data();
  const double* const x0 = searched[0].data();
  const double* const y0 = searched[1].data();
  const double* const z0 = searched[2].data();
  double largest[kLanes] = {};
  const auto shift2 = [&](std::size_t g) {
    const double ux = x[g] - scale[0] * x0[g];
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

Assembly::Assembly(const Packing& packing, double density, ContactModel model, int threads)
    : particles_(MakeParticles(packing, density)),
      model_(std::move(model)),
      threads_(threads),
      sliding_friction_(model_.sliding_friction()) {
  assert(particles_.size() > 0 && density > 0 && threads >= 1);
  std::copy(std::begin(packing.length), std::end(packing.length), std::begin(cell_.length));
  double radii = 0;
  for (const double r : particles_.radius) {
    solid_volume_ += 4.0 / 3.0 * std::numbers::pi * r * r * r;
    radii += r;
  }
  mean_diameter_ = 2 * radii / particles_.size();
  largest_radius_ = *std::max_element(particles_.radius.begin(), particles_.radius.end());
  reach_ = model_.Reach(largest_radius_);
  skin_ = kSkin * mean_diameter_ + reach_;
  nominal_critical_step_ = NominalStep(model_, particles_);
}

absl::Status Assembly::EvaluateForces() {
  if (list_.row.empty() || ListMayMissPairs()) {
    if (auto s = SearchNeighbors(); !s.ok()) {
      return s;
    }
  }
  for (int code = 0; code < kImages; ++code) {
    const int s[3] = {code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1};
    for (std::size_t a = 0; a < 3; ++a) {
      shift_[static_cast<std::size_t>(code)][a] = s[a] * cell_.length[a];
    }
  }
  ForEachChunk(static_cast<int>(sums_.size()), threads_,
               [this](int chunk) { EvaluateChunk(chunk); });
  stress_ = {0, 0, 0};
  contacts_ = 0;
  const double volume = cell_.Volume();
  for (const ChunkSums& sums : sums_) {
    contacts_ += sums.contacts;
    for (std::size_t a = 0; a < 3; ++a) {
      stress_[a] += sums.stress[a];
    }
  }
  for (double& s : stress_) {
    s /= volume;
  }
  contact_updates_ += contacts_;
  return absl::OkStatus();
}

bool Assembly::ListMayMissPairs() const {
  double shrink = 0;
  for (int a = 0; a < 3; ++a) {
    shrink = std::max(shrink, 1.0 - cell_.length[a] / searched_length_[a]);
  }
  // Two surfaces approach by at most both displacements and the affine shortening of their branch.
  return !(2 * moved_ + shrink * (2 * largest_radius_ + skin_) < skin_);
}

absl::Status Assembly::SearchNeighbors() {
  NeighborList old = std::exchange(list_, {});
  if (auto s = BuildNeighborList(cell_, skin_, particles_, list_); !s.ok()) {
    return s;
  }
  searched_[0] = particles_.x;
  searched_[1] = particles_.y;
  searched_[2] = particles_.z;
  std::copy(std::begin(cell_.length), std::end(cell_.length), std::begin(searched_length_));
  moved_ = 0;

  const auto slots = static_cast<std::size_t>(list_.size());
  const auto width = static_cast<std::size_t>(model_.history_size());
  std::vector<std::uint8_t> touching(slots, 0);
  std::vector<double> history(slots * width, 0.0);
  std::size_t o = 0;  // both lists are sorted by (i, j): one merge carries what contacts remember
  for (std::size_t s = 0; s < slots && !old.second.empty(); ++s) {
    const std::pair key(list_.first[s], list_.second[s]);
    while (o < old.second.size() && std::pair(old.first[o], old.second[o]) < key) {
      ++o;
    }
    if (o < old.second.size() && std::pair(old.first[o], old.second[o]) == key &&
        touching_[o] != 0) {
      touching[s] = 1;
      std::copy_n(&history_[o * width], width, &history[s * width]);
    }
  }
  touching_ = std::move(touching);
  history_ = std::move(history);
  loads_.assign(2 * slots, GrainLoad{});
  sums_.assign(static_cast<std::size_t>(ChunkCount(list_.size(), kPairChunk)), {});
  return absl::OkStatus();
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
    sums.contacts += reach_ > 0 && !overlaps ? 0 : 1;
    touching_.data()[slot] = 1;
    double* const remembered = history_.data() + static_cast<std::ptrdiff_t>(slot) * width;
    for (int c = 0; c < width; ++c) {
      remembered[c] = b.history[c][k];
    }
  }
  b.count = 0;
}

void Assembly::GatherLoads(std::size_t begin, std::size_t end) {
  ParticleArrays& p = particles_;
  const GrainLoad* load = loads_.data() + list_.place_row[begin];
  for (std::size_t g = begin; g < end; ++g) {
    const GrainLoad* const row_end = loads_.data() + list_.place_row.data()[g + 1];
    GrainLoad sum{};
    for (; load != row_end; ++load) {
      for (int a = 0; a < 3; ++a) {
        sum.force[a] += load->force[a];
        sum.torque[a] += load->torque[a];
      }
    }
    p.fx.data()[g] = sum.force[0];
    p.fy.data()[g] = sum.force[1];
    p.fz.data()[g] = sum.force[2];
    p.tx.data()[g] = sum.torque[0];
    p.ty.data()[g] = sum.torque[1];
    p.tz.data()[g] = sum.torque[2];
  }
}

double Assembly::MoveChunk(int chunk, const Motion& motion) {
  const auto begin = static_cast<std::size_t>(chunk) * kGrainChunk;
  const auto end = std::min(begin + kGrainChunk, particles_.x.size());
  double scale[3];
  for (int a = 0; a < 3; ++a) {
    scale[a] = cell_.length[a] / searched_length_[a];
  }
  GatherLoads(begin, end);
  AdvanceGrains(motion, static_cast<int>(begin), static_cast<int>(end), particles_);
  return LargestShift2(particles_, searched_, scale, begin, end);
}

void Assembly::Move(const Motion& motion) {
  for (int a = 0; a < 3; ++a) {
    cell_.stretch[a] = motion.stretch[a];
    cell_.length[a] += motion.dt * motion.stretch[a] * cell_.length[a];
  }
  last_dt_ = motion.dt;
  const int chunks = ChunkCount(particles_.size(), kGrainChunk);
  std::vector<double> moved2(static_cast<std::size_t>(chunks), 0.0);
  ForEachChunk(chunks, threads_, [&](int chunk) {
    moved2[static_cast<std::size_t>(chunk)] = MoveChunk(chunk, motion);
  });
  double largest = 0;
  for (const double m : moved2) {
    largest = m <= largest ? largest : m;
  }
  moved_ = std::sqrt(largest);
  ++steps_;
}

absl::Status Assembly::EstimateStiffness(StiffnessEstimate& estimate) const {
  const ParticleArrays& p = particles_;
  const auto n = p.x.size();
  std::vector<std::array<double, 6>> stiffness(n, {0, 0, 0, 0, 0, 0});  // translation, rotation
  std::vector<std::array<double, 6>> damping;  // as stiffness; empty without dashpots
  std::array<double, 3> modulus = {0, 0, 0};
  std::array<double, 3> viscosity = {0, 0, 0};
  ContactBlock b;
  b.viscous = viscous_ ? 1.0 : 0.0;
  absl::Status status;
  const auto add_damping = [&](int k, std::size_t i, std::size_t j) {
    if (!(b.normal_damping[k] + b.tangential_damping[k] > 0)) {
      return;
    }
    damping.resize(n, {0, 0, 0, 0, 0, 0});
    const double n2[3] = {b.nx[k] * b.nx[k], b.ny[k] * b.ny[k], b.nz[k] * b.nz[k]};
    const double d[3] = {b.dx[k], b.dy[k], b.dz[k]};
    for (std::size_t a = 0; a < 3; ++a) {
      const double across = b.tangential_damping[k] * (1.0 - n2[a]);
      const double translation = b.normal_damping[k] * n2[a] + across;
      viscosity[a] += translation * d[a] * d[a];
      damping[i][a] += translation;
      damping[j][a] += translation;
      damping[i][a + 3] += across * b.radius_i[k] * b.radius_i[k];
      damping[j][a + 3] += across * b.radius_j[k] * b.radius_j[k];
    }
  };
  const auto add = [&] {
    PadLanes(model_.history_size(), b);
    model_.Evaluate(b);
    for (int k = 0; k < b.count; ++k) {
      const auto slot = static_cast<std::size_t>(b.pair[k]);
      const auto i = static_cast<std::size_t>(list_.first[slot]);
      const auto j = static_cast<std::size_t>(list_.second[slot]);
      if (!(b.overlap[k] <= 0.5 * std::min(b.radius_i[k], b.radius_j[k])) && status.ok()) {
        status = absl::OutOfRangeError(absl::StrCat("grains ", p.id[i], " and ", p.id[j],
                                                    " overlap by ", b.overlap[k],
                                                    " m, more than half the smaller radius"));
      }
      add_damping(k, i, j);
      const double kn = b.normal_stiffness[k];
      const double ks = b.tangential_stiffness[k];
      const double n2[3] = {b.nx[k] * b.nx[k], b.ny[k] * b.ny[k], b.nz[k] * b.nz[k]};
      const double d[3] = {b.dx[k], b.dy[k], b.dz[k]};
      for (std::size_t a = 0; a < 3; ++a) {
        const double across = 1.0 - n2[a];
        const double translation = kn * n2[a] + ks * across;
        const double moment = b.rolling_stiffness[k] * across + b.twisting_stiffness[k] * n2[a];
        stiffness[i][a] += translation;
        stiffness[j][a] += translation;
        stiffness[i][a + 3] += ks * across * b.radius_i[k] * b.radius_i[k] + moment;
        stiffness[j][a + 3] += ks * across * b.radius_j[k] * b.radius_j[k] + moment;
        modulus[a] += translation * d[a] * d[a];
      }
    }
    b.count = 0;
  };
  for (int s = 0; s < list_.size(); ++s) {
    if (!touching(s)) {
      continue;
    }
    LoadLane(s, b);
    if (b.count == kBlock) {
      add();
    }
  }
  if (b.count > 0) {
    add();
  }
  double rate2 = 0;  // largest K/m
  for (std::size_t g = 0; g < n; ++g) {
    for (std::size_t a = 0; a < 3; ++a) {
      rate2 = std::max(
          {rate2, stiffness[g][a] * p.inverse_mass[g], stiffness[g][a + 3] * p.inverse_inertia[g]});
    }
  }
  double rate = std::sqrt(rate2);
  for (std::size_t g = 0; g < damping.size(); ++g) {
    for (std::size_t a = 0; a < 6; ++a) {
      const double inverse = a < 3 ? p.inverse_mass[g] : p.inverse_inertia[g];
      rate =
          std::max(rate, DampedRate(std::sqrt(stiffness[g][a] * inverse), damping[g][a] * inverse));
    }
  }
  estimate.critical_step = rate > 0 ? 1.0 / rate : 0.0;
  for (std::size_t a = 0; a < 3; ++a) {
    estimate.modulus[a] = modulus[a] / cell_.Volume();
    estimate.viscosity[a] = viscosity[a] / cell_.Volume();
  }
  return status;
}

double Assembly::UnbalancedForce() const {
  const ParticleArrays& p = particles_;
  double net = 0;
  std::int64_t loaded = 0;
  for (std::size_t g = 0; g < p.x.size(); ++g) {
    const double f2 = p.fx[g] * p.fx[g] + p.fy[g] * p.fy[g] + p.fz[g] * p.fz[g];
    if (f2 != 0) {
      net += std::sqrt(f2);
      ++loaded;
    }
  }
  double contact = 0;
  std::int64_t contacts = 0;
  for (std::size_t s = 0; s < touching_.size(); ++s) {
    if (touching_[s] != 0) {
      const double* f = load_on_j(static_cast<int>(s)).force;
      contact += std::sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
      ++contacts;
    }
  }
  if (loaded == 0 || contacts == 0) {
    return 0;
  }
  const double ratio =
      (net / static_cast<double>(loaded)) / (contact / static_cast<double>(contacts));
  return std::isfinite(ratio) ? ratio : std::numeric_limits<double>::infinity();
}

std::string Assembly::FirstNotFinite() const {
  const ParticleArrays& p = particles_;
  for (std::size_t g = 0; g < p.x.size(); ++g) {
    if (!std::isfinite(p.fx[g] + p.fy[g] + p.fz[g] + p.tx[g] + p.ty[g] + p.tz[g] + p.x[g] + p.y[g] +
                       p.z[g])) {
      return absl::StrCat("grain ", p.id[g], " has no finite force or position (NaN or lost)");
    }
  }
  return {};
}

}  // namespace calib::dem
