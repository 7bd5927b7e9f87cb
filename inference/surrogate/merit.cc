#include "inference/surrogate/merit.h"

#include <cassert>

namespace calib::inference {
namespace {

using Eigen::Index;

// Scaled to [0, 1]; all one where the values are equal [Alg. 4, steps c and d].
Eigen::VectorXd UnitScaled(const Eigen::VectorXd& values) {
  const double low = values.minCoeff();
  const double high = values.maxCoeff();
  if (!(high > low)) return Eigen::VectorXd::Ones(values.size());
  return (values.array() - low) / (high - low);
}

}  // namespace

Eigen::VectorXd Merits(const Eigen::VectorXd& surrogate, const Eigen::VectorXd& distances,
                       double weight) {
  return weight * UnitScaled(surrogate) + (1 - weight) * UnitScaled(-distances);
}

Index BestCandidate(const Eigen::VectorXd& surrogate, const Eigen::VectorXd& distances,
                    const MeritOptions& options) {
  assert(surrogate.size() == distances.size() && surrogate.size() >= 1);
  const Eigen::VectorXd merits = Merits(surrogate, distances, options.weight);
  Index best = -1;
  Index farthest = 0;
  for (Index i = 0; i < merits.size(); ++i) {
    if (distances[i] > distances[farthest]) farthest = i;
    if (distances[i] < options.min_distance) continue;
    if (best < 0 || merits[i] < merits[best]) best = i;
  }
  return best < 0 ? farthest : best;
}

}  // namespace calib::inference
