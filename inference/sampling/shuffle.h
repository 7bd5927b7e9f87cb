#pragma once
// Orders that depend on nothing but a key. Rows of designs are in an order of their own (in Halton's
// sequence every second one is above the middle of the first parameter), so that whatever goes by
// "every m-th row" (a packing, a half, a fold) would go by the parameters.

#include <Eigen/Core>
#include <vector>

#include "inference/sampling/philox.h"

namespace calib::inference {

/// 0 .. n-1, every order equally likely [Fisher & Yates 1938; Durstenfeld 1964]. n >= 0.
std::vector<Eigen::Index> Shuffled(Eigen::Index n, PhiloxStream stream);

/// 0 or 1 for each of n rows: of rows 2k and 2k+1 one each, which one by chance. n >= 0.
std::vector<int> Halves(Eigen::Index n);

}  // namespace calib::inference
