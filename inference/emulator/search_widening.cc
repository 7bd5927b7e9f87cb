#include "inference/emulator/search_widening.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

namespace calib::inference {
namespace {

constexpr double kShareOfMisfit = 0.5;

}  // namespace

double SearchWidening(const DataSet& data, std::span<const Iteration> iterations) {
  const auto t = static_cast<Eigen::Index>(data.readings.size());
  Eigen::RowVectorXd value(t);
  Eigen::RowVectorXd sd(t);
  for (Eigen::Index k = 0; k < t; ++k) {
    value[k] = data.readings[static_cast<std::size_t>(k)].value;
    sd[k] = data.readings[static_cast<std::size_t>(k)].sd;
  }
  double least = std::numeric_limits<double>::infinity();
  for (const Iteration& iteration : iterations) {
    for (const auto& row : iteration.predictions.rowwise()) {
      const double square = (row - value).cwiseQuotient(sd).squaredNorm();
      if (square < least) least = square;  // not NaN
    }
  }
  if (!std::isfinite(least)) return 1;
  return std::max(1.0, kShareOfMisfit * std::sqrt(least / static_cast<double>(t)));
}

}  // namespace calib::inference
