#pragma once
// Univariate priors, truncated where bounds are given. Units are the caller's (SI in calib).

#include <limits>
#include <string>

#include "absl/status/status.h"

namespace calib::inference {

enum class PriorKind { kUniform, kLogUniform, kNormal, kLogNormal };

/// kUniform, kLogUniform: on [min, max]. kNormal: mean, sd. kLogNormal: mean and sd of ln x. The
/// last two are truncated to [min, max] (infinite by default; log-normal to x > 0) and
/// renormalised. Thread safety: a value; every function is pure. All but Validate need a prior that
/// Validate accepts.
struct Prior {
  PriorKind kind = PriorKind::kUniform;
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  double mean = 0;
  double sd = 1;

  /// INVALID_ARGUMENT with one sentence: min >= max, log prior with min <= 0, sd <= 0, no mass
  /// between the bounds.
  absl::Status Validate() const;
  /// Share of the untruncated prior that lies between the bounds, [0, 1]; 1 for kinds that are
  /// their bounds.
  double MassBetweenBounds() const;
  bool InSupport(double x) const;
  /// Natural log of the density; -inf outside the support.
  double LogDensity(double x) const;
  /// Inverse of the distribution function, u in (0, 1); accurate also where the bounds leave a far
  /// tail only.
  double Quantile(double u) const;
  /// Phi^-1(F(x)), x in the support: the normal score, -inf and inf at the bounds; and its inverse.
  /// Both keep their digits in the tails.
  double NormalScore(double x) const;
  double FromNormalScore(double z) const;
  /// Standard deviation of x itself (not of ln x), by quadrature over the quantiles where no short
  /// closed form exists.
  double StandardDeviation() const;

  /// Coordinate in which mixtures are fitted: ln x for log priors, x otherwise; scaled to zero
  /// mean, unit sd of the prior. (A normal truncated so far out that its variance cancels is scaled
  /// by its quartiles instead.)
  double ToStandard(double x) const;
  double FromStandard(double s) const;
  /// ln |d standard / dx| at x.
  double LogJacobian(double x) const;
};

}  // namespace calib::inference
