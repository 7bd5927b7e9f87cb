#include "inference/scatter/chi_squared_law.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "inference/numerics/decompositions.h"
#include "inference/numerics/special_functions.h"

namespace calib::inference {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

double Freedom(double share_square, int packings) {
  return packings > 1 && share_square > 0 ? (packings - 1) / share_square : kInfinite;
}

}  // namespace

KnownFrom& KnownFrom::operator+=(const KnownFrom& other) {
  readings += other.readings;
  scatter += other.scatter;
  if (other.packings > 1)
    packings = packings > 1 ? std::min(packings, other.packings) : other.packings;
  return *this;
}

double KnownFrom::Freedom() const {
  return inference::Freedom(readings > 0 ? scatter / readings : 0, packings);
}

KnownFrom WhatIsKnown(const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& scatter,
                      int packings) {
  KnownFrom known{
      .readings = static_cast<double>(covariance.rows()), .scatter = 0, .packings = packings};
  if (packings < 2) return known;
  const Eigen::MatrixXd share = Solved(Eigen::LLT<Eigen::MatrixXd>(covariance), scatter);
  known.scatter = std::clamp(share.cwiseProduct(share.transpose()).sum(), 0.0, known.readings);
  return known;
}

double UpperTail(double chi2, double degrees, const KnownFrom& known) {
  const double freedom = known.Freedom();
  if (!std::isfinite(freedom)) return GammaQ(0.5 * degrees, 0.5 * chi2);
  return FisherLaw{.numerator = degrees, .denominator = freedom}.Tail(chi2 / degrees);
}

double NormalDeviate(double chi2, double degrees, const KnownFrom& known) {
  const double of_readings = 2 / (9 * degrees);
  const double of_scatter = 2 / (9 * known.Freedom());
  const double root = std::cbrt(chi2 / degrees);
  return ((1 - of_scatter) * root - (1 - of_readings)) /
         std::sqrt(of_scatter * root * root + of_readings);
}

double NormalDeviateOfMean(double ratio, double share, int packings) {
  const double freedom = Freedom(share * share, packings);
  if (!std::isfinite(freedom) || !std::isfinite(ratio)) return ratio;
  const double beyond = StudentLaw{.freedom = freedom}.Tail(std::abs(ratio));
  // So rare a value that a double does not hold its chance stays as it is.
  if (!(beyond > std::numeric_limits<double>::min())) return ratio;
  return std::copysign(NormalTailQuantile(beyond), ratio);
}

}  // namespace calib::inference
