#pragma once
// Rows of a design with a few effects on in each, so that every run is data for several effects.
// Pure.

#include <Eigen/Core>
#include <cstdint>
#include <utility>
#include <vector>

#include "inference/diagnosis/design_runs.h"

namespace calib::diagnosis {

/// What the rows are drawn from; K effects with H shape parameters together.
struct MixedDesign {
  Eigen::MatrixXd base{};                          ///< n x d: base parameters of each row
  std::vector<inference::DesignEffect> effects{};  ///< K
  Eigen::VectorXd low{}, high{};                   ///< K: strengths, 0 < low <= high
  Eigen::VectorXd other_low{}, other_high{};       ///< K: of negative ones; used if two-sided
  std::vector<std::pair<int, int>> apart{};        ///< pairs that are never on in one row
  std::uint64_t seed = 0;
};

/// n rows with two, three and four effects on in turn, as far as there are so many that may be
/// together. Sets are chosen one after the other, of 200 by chance the one that leaves the numbers
/// of uses of effects, then of pairs, most even. Strengths of an effect are a stratified sample,
/// log-uniform, both ends among them; signs as often one as the other; shapes a stratified sample
/// of
/// [-1, 1]. Deterministic in the seed.
inference::DesignPoints MixedRows(const MixedDesign& design);

}  // namespace calib::diagnosis
