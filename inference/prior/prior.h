#pragma once
// Univariate priors, truncated where bounds are given. Units are the caller's (SI in calib).

#include <limits>
#include <string>

#include "absl/status/status.h"

namespace calib::inference {

/// Family of a Prior. The log kinds are uniform or normal in ln x.
enum class PriorKind { kUniform, kLogUniform, kNormal, kLogNormal };

/// Prior distribution of one parameter x. kUniform, kLogUniform: on [min, max]. kNormal: of mean
/// `mean` and standard deviation `sd`; kLogNormal: ln x has those. The normal kinds are truncated
/// to [min, max] (infinite by default; log-normal to x > 0) and renormalised. A value; thread
/// safety: const, every function is pure. All functions but Validate need a prior that Validate
/// accepts.
struct Prior {
  PriorKind kind = PriorKind::kUniform;
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  double mean = 0;  ///< normal kinds: of x or ln x before truncation
  double sd = 1;    ///< normal kinds: of x or ln x before truncation, > 0

  /// INVALID_ARGUMENT with one sentence: min >= max, log prior with min <= 0, sd <= 0, no mass
  /// between the bounds.
  absl::Status Validate() const;
  /// Share of the untruncated prior that lies between the bounds, [0, 1]; 1 for kinds that are
  /// their bounds.
  double MassBetweenBounds() const;
  /// Whether x is finite and inside the bounds.
  bool InSupport(double x) const;
  /// Natural logarithm of the density at x; -infinity outside the support.
  double LogDensity(double x) const;
  /// Inverse of the distribution function F at u in (0, 1); accurate also where the bounds leave a
  /// far tail only.
  double Quantile(double u) const;
  /// Normal score Phi^-1(F(x)) of x in the support, F the distribution function and Phi the
  /// standard normal one; -infinity and infinity at the bounds. It keeps its digits in the tails.
  double NormalScore(double x) const;
  /// x whose normal score is z. It keeps its digits in the tails.
  double FromNormalScore(double z) const;
  /// Standard deviation of x itself (not of ln x): in closed form for the kinds without logarithm
  /// and for an unbounded log-normal, else by a midpoint rule over 2048 equally probable strips,
  /// which misses part of the tail of a log-normal without an upper bound.
  double StandardDeviation() const;

  /// Standardised coordinate s of x, the one in which mixtures are fitted: ln x for log kinds, x
  /// otherwise, shifted and scaled to zero mean and unit standard deviation of the prior. (A normal
  /// truncated so far out that its variance cancels is scaled by its quartiles instead.)
  double ToStandard(double x) const;
  /// x whose standardised coordinate is s.
  double FromStandard(double s) const;
  /// ln |ds / dx| at x, s the standardised coordinate.
  double LogJacobian(double x) const;
};

}  // namespace calib::inference
