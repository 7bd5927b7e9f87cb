#pragma once
// Sizes of avalanches: grains that leave an outlet between two blockages of it.

#include <cstddef>
#include <vector>

namespace calib::dem {

/// Takes the blockages of one outlet in order; what leaves after the last of them belongs to no
/// avalanche that has ended. Not thread-safe.
/// [Hadjidoukas et al. 2014, sec. 5.3]
class Avalanches {
 public:
  /// Tells that an arch has formed when `left` grains have left since the outlet was opened. Where
  /// no grain has left since the arch before, that arch was not broken: no avalanche.
  void Block(std::size_t left);

  /// Number of avalanches that have ended.
  [[nodiscard]] std::size_t count() const { return sizes_.size(); }

  /// Mean size of the avalanches that have ended [grains]. Precondition: count() > 0.
  [[nodiscard]] double Mean() const;

  /// The smallest size that at most a share p in [0, 1) of the avalanches exceeds, N_p of
  /// Pr(N > N_p) <= p [grains]: the median with p = 0.5. Precondition: count() > 0.
  [[nodiscard]] double ExceededBy(double p) const;

 private:
  std::vector<std::size_t> sizes_;  ///< ascending
  std::size_t before_ = 0;          ///< grains that had left at the last arch
};

}  // namespace calib::dem
