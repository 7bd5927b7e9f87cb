#include "inference/data/reading_noise.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/return_if_error.h"
#include "inference/numerics/special_functions.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr int kOrders[] = {3, 4};
constexpr Index kShortestRun = 5;  // readings of a run: they have one fourth difference
// The verdict's limits are chosen to say something only beyond doubt: the tests ReadingNoise.* of
// inference_unit_test see no word on 9000 simulated curves whose noise is as stated, nor on
// corners, waves and steep rises.
constexpr double kFewestDifferences = 6;  // effective differences
constexpr double kSure = 1e-3;            // chance beyond a limit
constexpr double kLarger = 1.3;           // times the stated error
constexpr double kSmaller = 1 / 1.5;      // times the stated error
constexpr double kStays = 0.6;            // share of a scale that the next order keeps of noise
// Median of the size of a standard normal number, and the efficiency of an estimate of scale by it.
//                                                  [Hampel, J. Am. Stat. Assoc. 69 (1974) 383]
constexpr double kNormalMedian = 0.6745;
constexpr double kMedianEfficiency = 0.37;

// Differences of neighbouring rows, taken `order` times.
Eigen::MatrixXd Differenced(Eigen::MatrixXd rows, int order) {
  for (int k = 0; k < order; ++k) {
    const Index left = rows.rows() - 1;
    rows = Eigen::MatrixXd(rows.bottomRows(left) - rows.topRows(left));
  }
  return rows;
}

struct OfOrder {
  std::vector<double> sizes{};  // each difference over its sd
  double correlation = 0;       // |R|_F^2 over all runs
  double scale = 0, robust = 0;
};

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

absl::StatusOr<OfOrder> Differences(const std::vector<ReadingRun>& runs, int order) {
  OfOrder all;
  for (const ReadingRun& run : runs) {
    const Index n = run.values.size();
    if (run.covariance.rows() != n || run.covariance.cols() != n || !run.values.allFinite() ||
        !run.covariance.allFinite()) {
      return absl::InvalidArgumentError("reading noise: a covariance does not fit its readings");
    }
    if (n < kShortestRun) continue;
    const Eigen::VectorXd differences = Differenced(run.values, order);
    Eigen::MatrixXd stated = Differenced(Differenced(run.covariance, order).transpose(), order);
    if (!(stated.diagonal().minCoeff() > 0)) {
      return absl::InvalidArgumentError("reading noise: stated errors leave differences none");
    }
    const Eigen::VectorXd sd = stated.diagonal().cwiseSqrt();
    for (Index i = 0; i < differences.size(); ++i) {
      all.sizes.push_back(std::abs(differences[i]) / sd[i]);
    }
    stated.array() /= (sd * sd.transpose()).array();
    all.correlation += stated.squaredNorm();
  }
  if (all.sizes.empty()) return all;
  double squares = 0;
  for (const double size : all.sizes) squares += size * size;
  all.scale = std::sqrt(squares / static_cast<double>(all.sizes.size()));
  all.robust = Median(all.sizes) / kNormalMedian;
  return all;
}

// Factor on an observed scale: the true one is below (upper) or above it but for kSure.
double LimitFactor(double degrees, bool upper) {
  const double chi2 =
      2 * (upper ? GammaPInverse(0.5 * degrees, kSure) : GammaQInverse(0.5 * degrees, kSure));
  return std::sqrt(degrees / chi2);
}

}  // namespace

absl::StatusOr<ReadingNoise> CompareReadingNoise(const std::vector<ReadingRun>& runs) {
  OfOrder third, fourth;
  for (const int order : kOrders) {
    ASSIGN_OR_RETURN((order == 3 ? third : fourth), Differences(runs, order));
  }
  ReadingNoise noise;
  if (fourth.sizes.empty()) return noise;
  const OfOrder& less = fourth.scale < third.scale ? fourth : third;
  const auto count = static_cast<double>(less.sizes.size());
  noise.differences = static_cast<int>(less.sizes.size());
  noise.effective = count * count / less.correlation;
  noise.scale = less.scale;
  noise.robust = std::min(third.robust, fourth.robust);
  if (noise.effective < kFewestDifferences) return noise;
  noise.surely_larger =
      noise.robust * LimitFactor(kMedianEfficiency * noise.effective, false) > kLarger &&
      fourth.robust > kStays * third.robust;
  noise.surely_smaller = noise.scale * LimitFactor(noise.effective, true) < kSmaller;
  return noise;
}

}  // namespace calib::inference
