// When the list of neighbours may miss a pair, and carrying what contacts remember to a new one.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "calib/return_if_error.h"
#include "dem/dynamics/assembly.h"
#include "dem/dynamics/chunks.h"

namespace calib::dem {
namespace {

/// Neighbouring lanes come from so many parts of a group, so that pairs of one grain lie apart:
/// each adds to what the one before it has left at the grain's place, and would wait for it.
constexpr std::size_t kParts = 8;

}  // namespace

bool Assembly::ListMayMissPairs() const {
  double shrink = 0;
  for (int a = 0; a < 3; ++a) {
    shrink = std::max(shrink, 1.0 - cell_.length[a] / searched_length_[a]);
  }
  shrink += std::abs(ShearSinceSearch());
  // Two surfaces approach by at most both displacements and the affine shortening of their branch.
  const double approach = moved_ + std::max(moved_, walls_.moved());
  return !(approach + shrink * (2 * largest_radius_ + skin_) < skin_);
}

double Assembly::ShearSinceSearch() const {
  // F_xz of the map F = H H0^-1 from the lattice of the search to that of now.
  return (cell_.Tilt() - cell_.length[0] / searched_length_[0] * searched_tilt_) /
         searched_length_[2];
}

absl::Status Assembly::SearchNeighbors() {
  cell_.Reduce();
  std::swap(list_, searching_.old);
  std::swap(order_, searching_.old_order);
  list_.row.clear();
  RETURN_IF_ERROR(searching_.search.Build(cell_, skin_, particles_, searching_.sorted));
  const bool rests = !cell_.open[0];  // grains in a periodic cell search seldom: room counts more
  if (rests) {
    searching_.search = {};
  }
  clumps_.Rewrap(cell_, particles_);
  searched_[0] = particles_.x;
  searched_[1] = particles_.y;
  searched_[2] = particles_.z;
  std::copy(std::begin(cell_.length), std::end(cell_.length), std::begin(searched_length_));
  searched_tilt_ = cell_.Tilt();
  moved_ = 0;
  stale_ = false;
  packed_ = false;  // grains were wrapped, have joined or left
  if (!walls_.empty()) {
    walls_.Search(particles_, skin_ + (wall_reach_ - reach_));
  }
  ArrangeLanes();
  CarryMemory();
  places_.Assign(particles_.size(), lanes_);
  forces_.assign(static_cast<std::size_t>(lanes_.blocks()), BlockForces{});
  sums_.assign(static_cast<std::size_t>(ChunkCount(list_.size(), kPairChunk)), {});
  if (rests) {
    searching_ = {};
  }
  return absl::OkStatus();
}

/// Within each chunk of the sorted list pairs that touch come first, then those that are close to
/// it: blocks of lanes then act wholly or not at all, as far as possible.
void Assembly::ArrangeLanes() {
  SetShifts();
  const ParticleArrays& p = particles_;
  const NeighborList& sorted = searching_.sorted;
  const auto slots = sorted.second.size();
  std::vector<std::uint8_t>& group = searching_.group;
  group.resize(slots);
  for (std::size_t s = 0; s < slots; ++s) {
    const auto i = static_cast<std::size_t>(sorted.first[s]);
    const auto j = static_cast<std::size_t>(sorted.second[s]);
    const ImageShift& shift = shift_[sorted.image[s]];
    const double dx = p.x[j] + shift[0] - p.x[i];
    const double dy = p.y[j] + shift[1] - p.y[i];
    const double dz = p.z[j] + shift[2] - p.z[i];
    const double d2 = dx * dx + dy * dy + dz * dz;
    const double touching = p.radius[i] + p.radius[j];
    const double close = touching + 0.25 * skin_;
    group[s] = d2 < touching * touching ? 0 : (d2 < close * close ? 1 : 2);
  }
  order_.resize(slots);
  int slot = 0;
  std::array<std::size_t, kPairChunk> members{};
  for (std::size_t begin = 0; begin < slots; begin += kPairChunk) {
    const std::size_t end = std::min(begin + kPairChunk, slots);
    for (int wanted = 0; wanted < 3; ++wanted) {
      std::size_t count = 0;
      for (std::size_t s = begin; s < end; ++s) {
        if (group[s] == wanted) {
          members[count++] = s;
        }
      }
      const std::size_t part = (count + kParts - 1) / kParts;
      for (std::size_t r = 0; r < part; ++r) {
        for (std::size_t t = r; t < count; t += part) {
          order_[members[t]] = slot++;
        }
      }
    }
  }
  list_.skin = sorted.skin;
  list_.row = sorted.row;
  list_.first.resize(slots);
  list_.second.resize(slots);
  list_.image.resize(slots);
  for (std::size_t s = 0; s < slots; ++s) {
    const auto to = static_cast<std::size_t>(order_[s]);
    list_.first[to] = sorted.first[s];
    list_.second[to] = sorted.second[s];
    list_.image[to] = sorted.image[s];
  }
  const std::size_t lanes = (slots + kBlock - 1) / kBlock * kBlock;
  const std::size_t last = slots == 0 ? 0 : (slots - 1) / kBlock * kBlock;  // begin of last block
  const auto pad = [&](const auto& values, const auto& with, auto& all) {
    all = values;
    all.resize(lanes, with);
  };
  if (slots == 0) {
    lanes_ = {};
    return;
  }
  pad(list_.first, list_.first[last], lanes_.first);
  pad(list_.second, list_.second[last], lanes_.second);
  pad(list_.image, list_.image[last], lanes_.image);
}

/// Both lists are visited in the order of (i, j): one merge carries over what contacts remember.
void Assembly::CarryMemory() {
  const NeighborList& old = searching_.old;
  const std::vector<int>& old_order = searching_.old_order;
  const std::vector<std::uint8_t>& old_touching = searching_.old_touching;
  std::swap(touching_, searching_.old_touching);
  std::swap(history_, searching_.old_history);
  const auto width = static_cast<std::size_t>(model_.history_size());
  const auto blocks = static_cast<std::size_t>(lanes_.blocks());
  touching_.assign(blocks * kBlock, 0);
  history_.assign(blocks * width, LaneColumn{});
  auto o = old_order.begin();
  for (const int slot : order_) {
    const auto s = static_cast<std::size_t>(slot);
    const std::pair key(list_.first[s], list_.second[s]);
    const auto key_of = [&old](int before) {
      const auto b = static_cast<std::size_t>(before);
      return std::pair(old.first[b], old.second[b]);
    };
    while (o != old_order.end() && key_of(*o) < key) {
      ++o;
    }
    if (o == old_order.end()) {
      break;
    }
    const auto from = static_cast<std::size_t>(*o);
    if (key_of(*o) == key && old_touching[from] != 0) {
      touching_[s] = 1;
      for (std::size_t c = 0; c < width; ++c) {
        history_[s / kBlock * width + c].lane[s % kBlock] =
            searching_.old_history[from / kBlock * width + c].lane[from % kBlock];
      }
    }
  }
}

}  // namespace calib::dem
