#pragma once
// How heavy the tail of the importance weights is. Pure functions.

#include <Eigen/Core>
#include <vector>

namespace calib::inference {

/// Shape k of the generalised Pareto distribution of excesses over a threshold, by an average over
/// the profile likelihood [Zhang & Stephens 2009], shrunk towards 1/2 with the weight of ten
/// observations [Vehtari et al. 2024, app. C].
/// in: excesses > 0, ascending, at least 5; not all equal
double GeneralizedParetoShape(const std::vector<double>& ascending_excesses);

/// Tail index k of N weights, the k-hat of Pareto smoothed importance sampling: the shape fitted to
/// the M = ceil(min(N/5, 3 sqrt(N))) largest weights over the next one. Moments of order below 1/k
/// exist: with k > 1/2 the variance is infinite, with k > 0.7 estimates cannot be trusted at
/// practical N.                                    [Vehtari, Simpson, Gelman, Yao & Gabry 2024]
/// in: log_weights: N, -infinity for a weight of zero; not normalised
/// out: k; +infinity when the tail holds fewer than 5 weights or when fewer samples than the tail
///      have weight; 0 when the tail weights are all equal
double ParetoTailIndex(const Eigen::VectorXd& log_weights);

}  // namespace calib::inference
