#pragma once
// Halton sequence [Halton 1960], unscrambled: the first design of Cheng 2018 and 2019.

#include <Eigen/Core>
#include <cstdint>

namespace calib::inference {

/// Radical inverse of index >= 0 in base >= 2: the digits of the index mirrored at the point,
/// sum_k digit_k base^-(k+1), correctly rounded. In [0, 1). Pure.                    [Halton 1960]
double RadicalInverse(std::uint64_t index, std::uint32_t base);

/// Points 1 ... n of the Halton sequence with the first d primes as bases, n x d in (0, 1); index
/// 0, the origin, is left out. n, d >= 0. Beyond about eight dimensions neighbouring columns are
/// visibly correlated at a hundred points: use ScrambledSobol (sobol.h) there. Pure.
Eigen::MatrixXd Halton(int n, int d);

}  // namespace calib::inference
