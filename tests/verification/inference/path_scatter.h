#pragma once
// What stand-ins for a granular run share: scatter that is correlated along the path, as perturbed
// repeats have, and measurements with independent errors.

#include <Eigen/Dense>
#include <cmath>
#include <cstdint>
#include <vector>

#include "inference/data/data_set.h"
#include "inference/sampling/philox.h"

namespace calib::inference {

/// Deviation of one run from the mean curve along its path: level, slope and a random walk that
/// forgets; unit variance up to the end of the path.
class PathScatter {
 public:
  explicit PathScatter(PhiloxStream& stream)
      : stream_(stream), level_(stream.Normal()), slope_(stream.Normal()) {}

  /// The next reading, at a share [0, 1) of the path.
  double Next(double share) {
    walk_ = 0.9 * walk_ + std::sqrt(1 - 0.81) * stream_.Normal();
    return 0.6 * level_ + 0.6 * slope_ * share + 0.5 * walk_;
  }

 private:
  PhiloxStream& stream_;
  double level_, slope_;
  double walk_ = 0;
};

inline PhiloxStream StreamOfRun(std::uint64_t seed, std::uint64_t sample) {
  return PhiloxStream(
      {.seed = seed, .purpose = StreamPurpose::kTest, .iteration = 1, .sample = sample});
}

/// The run that is measured; none of an ensemble.
constexpr std::uint64_t kMeasured = 1u << 20;

/// curve, sd: one after the other for each observable, as many readings as controls.
inline DataSet WithErrors(const Eigen::VectorXd& curve, const Eigen::VectorXd& sd,
                          const std::vector<double>& controls, std::uint64_t seed) {
  PhiloxStream stream({.seed = seed, .purpose = StreamPurpose::kTest, .iteration = 2, .sample = 0});
  const auto n = static_cast<int>(controls.size());
  DataSet data;
  for (int t = 0; t < curve.size(); ++t) {
    data.readings.push_back({.observable = t / n,
                             .load_step = t % n,
                             .control = controls[static_cast<std::size_t>(t % n)],
                             .value = curve[t] + sd[t] * stream.Normal(),
                             .sd = sd[t]});
  }
  return data;
}

}  // namespace calib::inference
