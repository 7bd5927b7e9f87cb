// What is asked of an assembly between steps: stiffness and the time step it allows, balance,
// finiteness.
#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "absl/strings/str_cat.h"
#include "dem/dynamics/assembly.h"
#include "dem/dynamics/chunks.h"

namespace calib::dem {
namespace {

/// Largest rate that the explicit step must follow, of an oscillator with a dashpot: the root of
/// (w/r)^2 + 2 (c/m)/r = 1, since forces use velocities half a step old; w without a dashpot.
/// w = sqrt(K/m) [1/s], damping c/m [1/s]
double DampedRate(double w, double damping) {
  return damping > 0 ? damping + std::sqrt(damping * damping + w * w) : w;
}

/// A chunk's places to their grains.
void AddRows(std::span<const int> grains, const std::vector<OwnStiffness>& rows,
             std::vector<OwnStiffness>& to) {
  for (std::size_t k = 0; k < rows.size(); ++k) {
    OwnStiffness& sum = to[static_cast<std::size_t>(grains[k])];
    for (std::size_t a = 0; a < 4; ++a) {
      sum.translation[a] += rows[k].translation[a];
      sum.rotation[a] += rows[k].rotation[a];
      sum.moment[a] += rows[k].moment[a];
      sum.shared[a] += rows[k].shared[a];
      sum.shared_off[a] += rows[k].shared_off[a];
      sum.shared_turn[a] += rows[k].shared_turn[a];
      sum.shared_turn_off[a] += rows[k].shared_turn_off[a];
    }
  }
}

/// Springs or dashpots of a contact [N/m], [N m/rad].
struct Held {
  double normal = 0;
  double tangential = 0;
  double rolling = 0;
  double twisting = 0;
};

/// What lane k does to the grain on the side of i, whose share of it is 1 where the other never
/// moves (a wall), 2 where it is a grain like it.
void AddLane(const ContactBlock& w, int k, const Held& by, double share, OwnStiffness& to) {
  const double n[3] = {w.nx[k], w.ny[k], w.nz[k]};
  const double r = w.radius_i[k];
  double* const couple[3] = {to.shared + 3, to.shared_off + 3, to.shared_turn + 3};
  for (std::size_t a = 0; a < 3; ++a) {
    const double n2 = n[a] * n[a];
    const double across = 1.0 - n2;
    const double both = n[a] * n[(a + 1) % 3];
    const double translation = by.normal * n2 + by.tangential * across;
    const double moment = by.rolling * across + by.twisting * n2;
    const double rotation = by.tangential * across * (r * r) + moment;
    to.translation[a] += translation;
    to.rotation[a] += rotation;
    to.moment[a] += moment;
    to.shared[a] += share * translation;
    to.shared_turn[a] += share * rotation;
    to.shared_off[a] += share * (by.normal - by.tangential) * both;
    to.shared_turn_off[a] += share * (by.twisting - by.rolling - by.tangential * (r * r)) * both;
    *couple[a] += share * by.tangential * r * n[a];
  }
}

Held SpringsOf(const ContactBlock& b, int k) {
  return {b.normal_stiffness[k] + b.may_stiffen[k], b.tangential_stiffness[k],
          b.rolling_stiffness[k], b.twisting_stiffness[k]};
}

Held DashpotsOf(const ContactBlock& b, int k) {
  return {.normal = b.normal_damping[k], .tangential = b.tangential_damping[k]};
}

/// Chunks of pairs whose stiffnesses are kept at a time for each of several threads [-]. Chosen:
/// enough work for each thread, little memory.
constexpr int kChunksOfThread = 4;

/// Overlap at which new contacts are judged, in radii [-]. Chosen: small, but not so small that a
/// Hertz contact has no stiffness.
constexpr double kNominalOverlap = 1e-4;

enum class Moments { kWith, kWithout };

/// The contact of a grain with one like it at an overlap given in radii; pair: of materials, where
/// there are several.
void NominalContact(const ContactModel& model, const ParticleArrays& p, std::size_t grain,
                    double overlap, int pair, ContactBlock& block) {
  block.mixed = model.materials() != nullptr;
  for (int k = 0; k < kBlock; ++k) {
    block.radius_i[k] = block.radius_j[k] = p.radius[grain];
    block.dx[k] = (2.0 - overlap) * p.radius[grain];
    block.materials[k] = pair;
  }
  model.Evaluate(block);
}

/// sqrt(m/K) of a grain in that contact.
double NominalStep(const ContactModel& model, const ParticleArrays& p, std::size_t grain,
                   double overlap, int pair, Moments moments) {
  ContactBlock block{};
  NominalContact(model, p, grain, overlap, pair, block);
  if (moments == Moments::kWithout) {
    block.rolling_stiffness[0] = block.twisting_stiffness[0] = 0.0;
  }
  const double translation =
      (block.normal_stiffness[0] + block.tangential_stiffness[0]) * p.inverse_mass[grain];
  const double rotation = (block.tangential_stiffness[0] * p.radius[grain] * p.radius[grain] +
                           block.rolling_stiffness[0] + block.twisting_stiffness[0]) *
                          p.inverse_inertia[grain];
  const double fastest = std::sqrt(std::max(translation, rotation));
  const double damping =
      (block.normal_damping[0] + block.tangential_damping[0]) * p.inverse_mass[grain];
  return 1.0 / DampedRate(fastest, damping);
}

}  // namespace

void Assembly::VisitSmallestGrains(
    const std::function<void(std::size_t grain, int pair)>& visit) const {
  const ParticleArrays& p = particles_;
  const Materials* materials = model_.materials();
  if (materials == nullptr) {
    const auto smallest = std::min_element(p.radius.begin(), p.radius.end()) - p.radius.begin();
    visit(static_cast<std::size_t>(smallest), 0);
    return;
  }
  // The smallest grain of each material against every material.
  for (int a = 0; a < materials->count(); ++a) {
    std::size_t smallest = p.radius.size();
    for (std::size_t g = 0; g < p.radius.size(); ++g) {
      if (MaterialOf(g) == a && (smallest == p.radius.size() || p.radius[g] < p.radius[smallest])) {
        smallest = g;
      }
    }
    for (int b = 0; b < materials->count() && smallest < p.radius.size(); ++b) {
      visit(smallest, materials->Pair(a, b));
    }
  }
}

double Assembly::LeastNominalStep(double overlap, bool with_moments) const {
  const Moments moments = with_moments ? Moments::kWith : Moments::kWithout;
  double least = std::numeric_limits<double>::infinity();
  VisitSmallestGrains([&](std::size_t grain, int pair) {
    least = std::min(least, NominalStep(model_, particles_, grain, overlap, pair, moments));
  });
  return least;
}

void Assembly::SetNominalStep() {
  nominal_critical_step_ = CriticalStepAt(kNominalOverlap);
  nominal_rates_ = {};
  VisitSmallestGrains([this](std::size_t grain, int pair) {
    ContactBlock b{};
    NominalContact(model_, particles_, grain, kNominalOverlap, pair, b);
    OwnStiffness spring{};
    OwnStiffness dashpot{};
    AddLane(b, 0, SpringsOf(b, 0), 2, spring);
    AddLane(b, 0, DashpotsOf(b, 0), 2, dashpot);
    const double m = particles_.inverse_mass[grain];
    const double i = particles_.inverse_inertia[grain];
    nominal_rates_.spring = std::max(nominal_rates_.spring, OwnRate(spring, m, i));
    nominal_rates_.dashpot = std::max(nominal_rates_.dashpot, OwnRate(dashpot, m, i));
  });
}

/// At most the largest rate of all bodies together, from the shares of each
/// (dem/dynamics/stable_step).
double Assembly::FastestOf(const std::vector<OwnStiffness>& own) const {
  const ParticleArrays& p = particles_;
  double fastest = 0;
  for (std::size_t g = 0; g < own.size(); ++g) {
    if (p.body.empty() || p.body[g] < 0) {
      fastest = std::max(fastest, OwnRate(own[g], p.inverse_mass[g], p.inverse_inertia[g]));
    }
  }
  std::vector<MemberStiffness> members;
  for (const Clump& clump : clumps_.all()) {
    members.clear();
    for (std::size_t s = 0; s < clump.members.size(); ++s) {
      members.push_back({&own[static_cast<std::size_t>(clump.members[s])], clump.arm[s]});
    }
    const auto first = static_cast<std::size_t>(clump.members.front());
    fastest = std::max(fastest, OwnRate(members, p.inverse_mass[first], p.inverse_inertia[first]));
  }
  return fastest;
}

double Assembly::CriticalStepAt(double overlap) const { return LeastNominalStep(overlap, true); }

double Assembly::NominalStepByForces() const { return LeastNominalStep(kNominalOverlap, false); }

/// What pair chunk `chunk` adds to the estimate.
void Assembly::SumStiffnessOfChunk(int chunk, ChunkStiffness& stiffness) const {
  constexpr int kBlocks = kPairChunk / kBlock;
  stiffness.Clear();
  ContactBlock b;
  b.viscous = viscous_ ? 1.0 : 0.0;
  const auto width = static_cast<std::size_t>(model_.history_size());
  const int places = static_cast<int>(places_.GrainsOf(chunk).size());
  const int end = std::min((chunk + 1) * kBlocks, lanes_.blocks());
  for (int block = chunk * kBlocks; block < end; ++block) {
    if (!AnyTouching(block)) {
      continue;
    }
    LoadBranches(lanes_, block, records_.data(), shift_, b);
    LoadGrains(lanes_, block, records_.data(), b);
    if (model_.common()) {
      CommonChainStiffness(*model_.common(), b);
    } else {
      for (std::size_t c = 0; c < width; ++c) {  // copies: evaluating must not move the memory on
        const double* const column = history_[ColumnsOf(static_cast<std::size_t>(block)) + c].lane;
        std::copy_n(column, kBlock, b.history[c]);
      }
      LoadMaterials(block, b);
      model_.Evaluate(b);
    }
    AddStiffness(lanes_, block, b, touching_.data() + static_cast<std::ptrdiff_t>(block) * kBlock,
                 places, stiffness);
  }
}

/// The steps that the axes of single bodies allow; clumps become their first spheres in
/// estimating_.
void Assembly::SetStepsAlongAxes(StiffnessEstimate& estimate) {
  std::vector<OwnStiffness>& springs = estimating_.springs;
  std::vector<OwnStiffness>& dashpots = estimating_.dashpots;
  clumps_.Fold(springs);
  if (!dashpots.empty()) {
    clumps_.Fold(dashpots);
  }
  double elastic2 = 0;  // squares of the fastest rates
  double by_forces2 = 0;
  double damped = 0;
  for (std::size_t g = 0; g < springs.size(); ++g) {
    const double inverse_mass = particles_.inverse_mass[g];
    const double inverse_inertia = particles_.inverse_inertia[g];
    const OwnStiffness& own = springs[g];
    for (std::size_t a = 0; a < 3; ++a) {
      const double translation2 = own.translation[a] * inverse_mass;
      const double rotation2 = own.rotation[a] * inverse_inertia;
      const double turned_by_forces = std::max(0.0, own.rotation[a] - own.moment[a]);
      elastic2 = std::max({elastic2, translation2, rotation2});
      by_forces2 = std::max({by_forces2, translation2, turned_by_forces * inverse_inertia});
      if (!dashpots.empty()) {
        damped = std::max(
            {damped, DampedRate(std::sqrt(translation2), dashpots[g].translation[a] * inverse_mass),
             DampedRate(std::sqrt(rotation2), dashpots[g].rotation[a] * inverse_inertia)});
      }
    }
  }
  const auto step = [](double rate) { return rate > 0 ? 1.0 / rate : 0.0; };
  estimate.elastic_step = step(std::sqrt(elastic2));
  estimate.step_by_forces = step(std::sqrt(by_forces2));
  estimate.critical_step = step(std::max(std::sqrt(elastic2), damped));
}

absl::Status Assembly::EstimateStiffness(StiffnessEstimate& estimate) {
  const ParticleArrays& p = particles_;
  const auto n = p.x.size();
  std::vector<ChunkStiffness>& chunks = estimating_.chunks;
  std::vector<OwnStiffness>& springs = estimating_.springs;
  std::vector<OwnStiffness>& dashpots = estimating_.dashpots;
  springs.assign(n, OwnStiffness{});
  dashpots.clear();
  double rolling = 0;  // sum over contacts [N m/rad]
  double twisting = 0;
  std::array<double, 3> modulus = {0, 0, 0};
  std::array<double, 3> viscosity = {0, 0, 0};
  absl::Status status;
  const int count = static_cast<int>(sums_.size());
  const int together = std::min(count, threads_ > 1 ? kChunksOfThread * threads_ : 1);
  chunks.resize(static_cast<std::size_t>(together));
  for (int c = 0; c < count; ++c) {
    if (c % together == 0) {
      ForEachChunk(std::min(together, count - c), threads_, [this, c, &chunks](int k) {
        SumStiffnessOfChunk(c + k, chunks[static_cast<std::size_t>(k)]);
      });
    }
    const ChunkStiffness& chunk = chunks[static_cast<std::size_t>(c % together)];
    if (chunk.too_deep >= 0 && status.ok()) {
      const auto slot = static_cast<std::size_t>(chunk.too_deep);
      status = absl::OutOfRangeError(
          absl::StrCat("grains ", p.id[static_cast<std::size_t>(list_.first[slot])], " and ",
                       p.id[static_cast<std::size_t>(list_.second[slot])], " overlap by ",
                       chunk.deepest_there, " m, more than half the smaller radius"));
    }
    const std::span<const int> grains = places_.GrainsOf(c);
    AddRows(grains, chunk.spring, springs);
    if (!chunk.dashpot.empty()) {
      dashpots.resize(n, OwnStiffness{});
      AddRows(grains, chunk.dashpot, dashpots);
    }
    rolling += chunk.rolling;
    twisting += chunk.twisting;
    for (std::size_t a = 0; a < 3; ++a) {
      modulus[a] += chunk.modulus[a];
      viscosity[a] += chunk.viscosity[a];
    }
  }
  walls_.VisitBlocks(p, model_, viscous_, [&](const ContactBlock& w, const int* grains) {
    for (int k = 0; k < w.count; ++k) {
      const auto i = static_cast<std::size_t>(grains[k]);
      if (!(w.overlap[k] <= 0.5 * w.radius_i[k]) && status.ok()) {
        status = absl::OutOfRangeError(absl::StrCat("grain ", p.id[i], " overlaps a wall by ",
                                                    w.overlap[k], " m, more than half its radius"));
      }
      AddLane(w, k, SpringsOf(w, k), 1, springs[i]);
      if (w.normal_damping[k] + w.tangential_damping[k] > 0) {
        dashpots.resize(n, OwnStiffness{});
        AddLane(w, k, DashpotsOf(w, k), 1, dashpots[i]);
      }
      rolling += w.rolling_stiffness[k];
      twisting += w.twisting_stiffness[k];
    }
  });
  estimate.fastest.spring = FastestOf(springs);
  estimate.fastest.dashpot = dashpots.empty() ? 0.0 : FastestOf(dashpots);
  estimate.by_twisting = twisting > rolling;
  SetStepsAlongAxes(estimate);
  for (std::size_t a = 0; a < 3; ++a) {
    estimate.modulus[a] = modulus[a] / cell_.Volume();
    estimate.viscosity[a] = viscosity[a] / cell_.Volume();
  }
  return status;
}

double Assembly::MomentDelay(const StiffnessEstimate& estimate) const {
  if (!(estimate.elastic_step > 0)) return 1.0;  // nothing touches, or no grain is there yet
  const double nominal = NominalStepByForces();
  const double by_forces =
      estimate.step_by_forces > 0 ? std::min(nominal, estimate.step_by_forces) : nominal;
  return by_forces / estimate.elastic_step;
}

std::string Assembly::MomentStepText(const StiffnessEstimate& estimate) const {
  return absl::StrCat("the stiffness of ",
                      estimate.by_twisting ? "twisting_resistance" : "rolling_resistance",
                      " makes the time step ", std::lround(MomentDelay(estimate)),
                      " times shorter than the contact forces do (", estimate.elastic_step, " s)");
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
      const Vec3 f = force_on_j(static_cast<int>(s));
      contact += std::sqrt(f.x * f.x + f.y * f.y + f.z * f.z);
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
