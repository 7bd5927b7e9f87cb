#include "dem/measure/avalanches.h"

#include <algorithm>
#include <numeric>

namespace calib::dem {

void Avalanches::Block(std::size_t left) {
  if (left > before_) {
    const std::size_t size = left - before_;
    sizes_.insert(std::upper_bound(sizes_.begin(), sizes_.end(), size), size);
  }
  before_ = left;
}

double Avalanches::Mean() const {
  return static_cast<double>(std::accumulate(sizes_.begin(), sizes_.end(), std::size_t{0})) /
         static_cast<double>(sizes_.size());
}

double Avalanches::ExceededBy(double p) const {
  const auto allowed = static_cast<std::size_t>(p * static_cast<double>(sizes_.size()) + 1e-9);
  return static_cast<double>(sizes_[sizes_.size() - 1 - allowed]);
}

}  // namespace calib::dem
