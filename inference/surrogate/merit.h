#pragma once
// Which candidate to evaluate next [Regis & Shoemaker 2007; Samuelsson 2023, Alg. 4]. Pure
// functions.

#include <Eigen/Core>

namespace calib::inference {

/// How candidates are weighed.
struct MeritOptions {
  double weight = 0.5;  ///< of the surrogate's value against the distance, [0, 1]; large exploits
  /// >= 0: candidates closer to any point already chosen are passed over.
  double min_distance = 1e-3;
};

/// Merit weight V_R + (1 - weight) V_D of each of m candidates, small is good: V_R the surrogate's
/// value and V_D the distance to the nearest chosen point, both scaled to [0, 1] over the
/// candidates, V_D falling with the distance; one where all are equal.
Eigen::VectorXd Merits(const Eigen::VectorXd& surrogate, const Eigen::VectorXd& distances,
                       double weight);

/// Index of the candidate of least merit among those at least min_distance away, the first of
/// equals; the farthest one when all lie closer.
/// in: surrogate values and distances to the nearest chosen point of m >= 1 candidates
Eigen::Index BestCandidate(const Eigen::VectorXd& surrogate, const Eigen::VectorXd& distances,
                           const MeritOptions& options);

}  // namespace calib::inference
