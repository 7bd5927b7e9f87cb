// When the list of neighbours may miss a pair, and carrying what contacts remember to a new one.
#include <algorithm>
#include <cmath>
#include <utility>

#include "dem/dynamics/assembly.h"
#include "dem/dynamics/chunks.h"

namespace calib::dem {

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
  NeighborList old = std::exchange(list_, {});
  if (auto s = BuildNeighborList(cell_, skin_, particles_, list_); !s.ok()) {
    return s;
  }
  clumps_.Rewrap(cell_, particles_);
  searched_[0] = particles_.x;
  searched_[1] = particles_.y;
  searched_[2] = particles_.z;
  std::copy(std::begin(cell_.length), std::end(cell_.length), std::begin(searched_length_));
  searched_tilt_ = cell_.Tilt();
  moved_ = 0;
  stale_ = false;
  if (!walls_.empty()) {
    walls_.Search(particles_, skin_);
  }

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

}  // namespace calib::dem
