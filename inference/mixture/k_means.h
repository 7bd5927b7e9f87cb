#pragma once
// Clusters from which the mixture's iterations start.

#include <Eigen/Core>
#include <vector>

#include "inference/mixture/variational_steps.h"
#include "inference/sampling/philox.h"

namespace calib::inference {

/// Cluster label, 0 ... clusters - 1, of each of n points: greedy k-means++ seeds (each the best of
/// 2 + ln k candidates drawn in proportion to weighted squared distance)
/// [Arthur & Vassilvitskii 2007, sec. 6] and at most 300 of Lloyd's iterations. Deterministic in
/// the stream. With fewer distinct points than clusters some labels stay unused.
/// in: data with at least one positive count, clusters >= 1
std::vector<int> KMeans(const WeightedPoints& data, int clusters, PhiloxStream& stream);

}  // namespace calib::inference
