#pragma once
// Which parameters move an output, over the whole range of their prior: variance-based indices.

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace calib::inference {

/// Variance-based indices of one output y(x_1 ... x_d), independent x_j:
///   first_j = Var(E[y | x_j]) / Var(y),   total_j = 1 - Var(E[y | x_-j]) / Var(y)
///                                                              [Sobol 1993; Homma & Saltelli 1996]
/// An index may come out slightly below 0 or above 1: its error is stated, it is not clipped.
struct SobolIndices {
  Eigen::VectorXd first, total;              ///< d; NaN where the output does not vary
  Eigen::VectorXd first_error, total_error;  ///< d, standard errors
  double mean = 0;                           ///< of the output
  double variance = 0;                       ///< of the output
};

/// Sample sizes of the indices; chosen.
struct SobolOptions {
  int points = 1024;    ///< N of a set, a power of two for the balance of Sobol points, >= 2
  int replicates = 16;  ///< independently scrambled sets, whose spread is the error, >= 2
  std::uint64_t seed = 0;
};

/// A function of the unit cube: k outputs (m x k) at m points (m x d).
using UnitFunction = std::function<Eigen::MatrixXd(const Eigen::MatrixXd&)>;

/// `replicates` sets of N points in the unit cube of 2 d dimensions, N x 2d each: matrices A and B
/// of [Saltelli et al. 2010], side by side. Made once, they serve any number of functions. Pure.
std::vector<Eigen::MatrixXd> SobolSets(int dimensions, const SobolOptions& options);

/// Indices of each output of f: first order by [Saltelli et al. 2010, Table 2 (b)], total by
/// [Jansen 1999], both from N (d + 2) evaluations per set; sets: two at least, of SobolSets. Pure
/// where f is.
std::vector<SobolIndices> EstimateSobolIndices(std::span<const Eigen::MatrixXd> sets,
                                               const UnitFunction& f);

}  // namespace calib::inference
