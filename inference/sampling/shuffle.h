#pragma once
// Orders by chance. Rows of designs are in an order of their own (in Halton's sequence every second
// one is above the middle of the first parameter), so that whatever goes by "every m-th row" (a
// packing, a half, a fold) would go by the parameters.

#include <Eigen/Core>
#include <vector>

#include "inference/sampling/philox.h"

namespace calib::inference {

/// 0 .. n-1 in an order by chance, every order equally likely. n >= 0. Deterministic in the stream,
/// of which it takes a copy.
///                                                          [Fisher & Yates 1938; Durstenfeld 1964]
std::vector<Eigen::Index> Shuffled(Eigen::Index n, PhiloxStream stream);

/// The half, 0 or 1, that each of n rows belongs to: rows 2k and 2k+1 are in different halves,
/// which of the two is in which by chance. n >= 0. Deterministic in n, and row i does not depend on
/// n.
std::vector<int> Halves(Eigen::Index n);

}  // namespace calib::inference
