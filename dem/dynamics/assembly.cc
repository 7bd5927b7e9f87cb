#include "dem/dynamics/assembly.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/dynamics/chunks.h"

namespace calib::dem {
namespace {

/// Gap up to which pairs are listed, over the mean diameter: a wider skin lists more pairs, a
/// narrower one searches more often. Measured best on dense packings of 1000 to 10 000 grains.
constexpr double kSkin = 0.06;

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
  return 1.0 / std::sqrt(std::max(translation, rotation));
}

/// Local damping of one component: the force opposing the motion is enlarged, the driving one
/// reduced. [Cundall 1987]
inline double Damped(double acceleration, double velocity, double dt, double damping) {
  const double direction = acceleration * (velocity + 0.5 * dt * acceleration);
  const double sign = direction > 0 ? 1.0 : (direction < 0 ? -1.0 : 0.0);
  return acceleration * (1.0 - damping * sign);
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
  skin_ = kSkin * mean_diameter_;
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
  searched_x_ = particles_.x;
  searched_y_ = particles_.y;
  searched_z_ = particles_.z;
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
  loads_.assign(slots, PairLoad{});
  sums_.assign(static_cast<std::size_t>(ChunkCount(list_.size(), kPairChunk)), {});
  return absl::OkStatus();
}

void Assembly::LoadLane(int slot, const double* d, ContactBlock& b) const {
  const int k = b.count++;
  const ParticleArrays& p = particles_;
  const auto i = static_cast<std::size_t>(list_.first[static_cast<std::size_t>(slot)]);
  const auto j = static_cast<std::size_t>(list_.second[static_cast<std::size_t>(slot)]);
  b.pair[k] = slot;
  b.dx[k] = d[0];
  b.dy[k] = d[1];
  b.dz[k] = d[2];
  b.radius_i[k] = p.radius[i];
  b.radius_j[k] = p.radius[j];
  b.vx[k] = p.vx[j] - p.vx[i];
  b.vy[k] = p.vy[j] - p.vy[i];
  b.vz[k] = p.vz[j] - p.vz[i];
  b.wix[k] = p.wx[i];
  b.wiy[k] = p.wy[i];
  b.wiz[k] = p.wz[i];
  b.wjx[k] = p.wx[j];
  b.wjy[k] = p.wy[j];
  b.wjz[k] = p.wz[j];
  const int width = model_.history_size();
  const double* remembered =
      &history_[static_cast<std::size_t>(slot) * static_cast<std::size_t>(width)];
  for (int c = 0; c < width; ++c) {
    b.history[c][k] = remembered[c];
  }
}

namespace {

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

}  // namespace

void Assembly::EvaluateChunk(int chunk) {
  ContactBlock block;
  block.dt = last_dt_;
  block.sliding_friction = sliding_friction_;
  std::copy(std::begin(cell_.stretch), std::end(cell_.stretch), std::begin(block.stretch));
  ChunkSums sums;
  const ParticleArrays& p = particles_;
  const auto begin = static_cast<std::size_t>(chunk) * kPairChunk;
  const auto end = std::min(begin + kPairChunk, list_.second.size());
  const auto width = static_cast<std::size_t>(model_.history_size());
  for (std::size_t s = begin; s < end; ++s) {
    const auto i = static_cast<std::size_t>(list_.first[s]);
    const auto j = static_cast<std::size_t>(list_.second[s]);
    const std::array<double, 3>& shift = shift_[list_.image[s]];
    const double d[3] = {p.x[j] + shift[0] - p.x[i], p.y[j] + shift[1] - p.y[i],
                         p.z[j] + shift[2] - p.z[i]};
    const double reach = p.radius[i] + p.radius[j];
    if (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] < reach * reach) {
      LoadLane(static_cast<int>(s), d, block);
      if (block.count == kBlock) {
        StoreBlock(block, sums);
      }
    } else if (touching_[s] != 0) {  // the contact opens and forgets
      touching_[s] = 0;
      loads_[s] = PairLoad{};
      std::fill_n(&history_[s * width], width, 0.0);
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
    const auto slot = static_cast<std::size_t>(b.pair[k]);
    const double f[3] = {b.normal_force[k] * b.nx[k] + b.fx[k],
                         b.normal_force[k] * b.ny[k] + b.fy[k],
                         b.normal_force[k] * b.nz[k] + b.fz[k]};
    // n x Fs; arms reach from the centres to the middle of the overlap.
    const double t[3] = {b.ny[k] * b.fz[k] - b.nz[k] * b.fy[k],
                         b.nz[k] * b.fx[k] - b.nx[k] * b.fz[k],
                         b.nx[k] * b.fy[k] - b.ny[k] * b.fx[k]};
    const double m[3] = {b.mx[k], b.my[k], b.mz[k]};
    const double arm_i = b.radius_i[k] - 0.5 * b.overlap[k];
    const double arm_j = b.radius_j[k] - 0.5 * b.overlap[k];
    PairLoad& load = loads_[slot];
    for (int a = 0; a < 3; ++a) {
      load.force[a] = f[a];
      load.torque_i[a] = -arm_i * t[a] - m[a];
      load.torque_j[a] = -arm_j * t[a] + m[a];
    }
    sums.stress[0] += f[0] * b.dx[k];
    sums.stress[1] += f[1] * b.dy[k];
    sums.stress[2] += f[2] * b.dz[k];
    touching_[slot] = 1;
    double* remembered = &history_[slot * static_cast<std::size_t>(width)];
    for (int c = 0; c < width; ++c) {
      remembered[c] = b.history[c][k];
    }
  }
  sums.contacts += b.count;
  b.count = 0;
}

void Assembly::GatherLoads(int grain) {
  ParticleArrays& p = particles_;
  const auto g = static_cast<std::size_t>(grain);
  double force[3] = {0, 0, 0};
  double torque[3] = {0, 0, 0};
  for (int e = list_.incident_row[g]; e < list_.incident_row[g + 1]; ++e) {
    const int incident = list_.incident[static_cast<std::size_t>(e)];
    const PairLoad& load = loads_[static_cast<std::size_t>(incident >> 1)];
    const bool is_j = (incident & 1) != 0;
    const double sign = is_j ? 1.0 : -1.0;
    const double* pair_torque = is_j ? load.torque_j : load.torque_i;
    for (int a = 0; a < 3; ++a) {
      force[a] += sign * load.force[a];
      torque[a] += pair_torque[a];
    }
  }
  p.fx[g] = force[0];
  p.fy[g] = force[1];
  p.fz[g] = force[2];
  p.tx[g] = torque[0];
  p.ty[g] = torque[1];
  p.tz[g] = torque[2];
}

double Assembly::MoveChunk(int chunk, const Motion& motion) {
  ParticleArrays& p = particles_;
  const double dt = motion.dt;
  const double damping = motion.damping;
  const auto begin = static_cast<std::size_t>(chunk) * kGrainChunk;
  const auto end = std::min(begin + kGrainChunk, p.x.size());
  double scale[3];
  for (int a = 0; a < 3; ++a) {
    scale[a] = cell_.length[a] / searched_length_[a];
  }
  for (std::size_t g = begin; g < end; ++g) {
    GatherLoads(static_cast<int>(g));
  }
  double moved2 = 0;
  for (std::size_t g = begin; g < end; ++g) {
    const double im = p.inverse_mass[g];
    const double ii = p.inverse_inertia[g];
    p.vx[g] += dt * Damped(p.fx[g] * im, p.vx[g], dt, damping);
    p.vy[g] += dt * Damped(p.fy[g] * im, p.vy[g], dt, damping);
    p.vz[g] += dt * Damped(p.fz[g] * im, p.vz[g], dt, damping);
    p.wx[g] += dt * Damped(p.tx[g] * ii, p.wx[g], dt, damping);
    p.wy[g] += dt * Damped(p.ty[g] * ii, p.wy[g], dt, damping);
    p.wz[g] += dt * Damped(p.tz[g] * ii, p.wz[g], dt, damping);
    p.x[g] += dt * (p.vx[g] + motion.stretch[0] * p.x[g]);
    p.y[g] += dt * (p.vy[g] + motion.stretch[1] * p.y[g]);
    p.z[g] += dt * (p.vz[g] + motion.stretch[2] * p.z[g]);
    const double ux = p.x[g] - scale[0] * searched_x_[g];
    const double uy = p.y[g] - scale[1] * searched_y_[g];
    const double uz = p.z[g] - scale[2] * searched_z_[g];
    const double u2 = ux * ux + uy * uy + uz * uz;
    moved2 = u2 > moved2 || u2 != u2
                 ? u2
                 : moved2;  // a NaN stays, and forces a search that names the grain
  }
  return moved2;
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
    largest = m > largest || m != m ? m : largest;
  }
  moved_ = std::sqrt(largest);
  ++steps_;
}

absl::Status Assembly::EstimateStiffness(StiffnessEstimate& estimate) const {
  const ParticleArrays& p = particles_;
  const auto n = p.x.size();
  std::vector<std::array<double, 6>> stiffness(n, {0, 0, 0, 0, 0, 0});  // translation, rotation
  std::array<double, 3> modulus = {0, 0, 0};
  ContactBlock b;
  absl::Status status;
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
    const auto slot = static_cast<std::size_t>(s);
    const auto i = static_cast<std::size_t>(list_.first[slot]);
    const auto j = static_cast<std::size_t>(list_.second[slot]);
    const std::array<double, 3>& shift = shift_[list_.image[slot]];
    const double d[3] = {p.x[j] + shift[0] - p.x[i], p.y[j] + shift[1] - p.y[i],
                         p.z[j] + shift[2] - p.z[i]};
    LoadLane(s, d, b);
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
  estimate.critical_step = rate2 > 0 ? 1.0 / std::sqrt(rate2) : 0.0;
  for (std::size_t a = 0; a < 3; ++a) {
    estimate.modulus[a] = modulus[a] / cell_.Volume();
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
  for (std::size_t s = 0; s < loads_.size(); ++s) {
    if (touching_[s] != 0) {
      const double* f = loads_[s].force;
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
