#include "inference/mixture/k_means.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace calib::inference {
namespace {

// Index drawn in proportion to the masses; the last of positive mass where rounding leaves a
// remainder.
Eigen::Index DrawIndex(const Eigen::VectorXd& masses, PhiloxStream& stream) {
  double total = 0;
  for (const double mass : masses) total += mass;
  double remaining = stream.Uniform() * total;
  Eigen::Index last = 0;
  for (Eigen::Index i = 0; i < masses.size(); ++i) {
    if (!(masses[i] > 0)) continue;
    last = i;
    remaining -= masses[i];
    if (remaining < 0) break;
  }
  return last;
}

Eigen::VectorXd SquaredDistances(const Eigen::MatrixXd& points, const Eigen::VectorXd& centre) {
  return (points.colwise() - centre).colwise().squaredNorm();
}

double Sum(const Eigen::VectorXd& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum;
}

Eigen::MatrixXd Seeds(const WeightedPoints& data, int clusters, PhiloxStream& stream) {
  Eigen::MatrixXd centres(data.points.rows(), clusters);
  centres.col(0) = data.points.col(DrawIndex(data.counts, stream));
  Eigen::VectorXd nearest = SquaredDistances(data.points, centres.col(0));
  const int trials = 2 + static_cast<int>(std::log(clusters));
  for (int k = 1; k < clusters; ++k) {
    double best_potential = std::numeric_limits<double>::infinity();
    Eigen::VectorXd best_nearest;
    for (int trial = 0; trial < trials; ++trial) {
      const Eigen::Index candidate = DrawIndex(nearest.cwiseProduct(data.counts), stream);
      const Eigen::VectorXd closer =
          nearest.cwiseMin(SquaredDistances(data.points, data.points.col(candidate)));
      const double potential = Sum(closer.cwiseProduct(data.counts));
      if (potential < best_potential) {
        best_potential = potential;
        best_nearest = closer;
        centres.col(k) = data.points.col(candidate);
      }
    }
    nearest = best_nearest;
  }
  return centres;
}

}  // namespace

std::vector<int> KMeans(const WeightedPoints& data, int clusters, PhiloxStream& stream) {
  assert(clusters >= 1 && data.points.cols() > 0);
  constexpr int kMostIterations = 300;  // scikit-learn's default; some ten are the rule
  const Eigen::Index n = data.points.cols();
  Eigen::MatrixXd centres = Seeds(data, clusters, stream);
  std::vector<int> labels(n, -1);
  for (int iteration = 0; iteration < kMostIterations; ++iteration) {
    bool changed = false;
    Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(centres.rows(), clusters);
    Eigen::VectorXd sizes = Eigen::VectorXd::Zero(clusters);
    // |x - c|^2 - |x|^2, cluster by cluster: points far from the origin lose digits of the
    // distance, which decides ties alone.
    Eigen::MatrixXd distances(clusters, n);
    distances.noalias() = -2 * centres.transpose() * data.points;
    distances.colwise() += centres.colwise().squaredNorm().transpose();
    for (Eigen::Index i = 0; i < n; ++i) {
      Eigen::Index nearest = 0;
      distances.col(i).minCoeff(&nearest);
      changed = changed || labels[i] != nearest;
      labels[i] = static_cast<int>(nearest);
      sums.col(nearest) += data.counts[i] * data.points.col(i);
      sizes[nearest] += data.counts[i];
    }
    if (!changed) break;
    for (int k = 0; k < clusters; ++k) {
      if (sizes[k] > 0) centres.col(k) = sums.col(k) / sizes[k];
    }
  }
  return labels;
}

}  // namespace calib::inference
