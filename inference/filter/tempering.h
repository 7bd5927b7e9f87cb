#pragma once
// The exponent of the likelihood that gives a wanted effective sample size.

#include <Eigen/Core>

namespace calib::inference {

/// An exponent of the likelihood, for weights w_i ∝ exp(log_start_i + exponent * log_likelihood_i).
struct Tempering {
  double exponent = 1;   ///< in (0, max_exponent]
  double ess = 0;        ///< effective number of samples at the exponent
  bool reached = false;  ///< ess equals the target (or exceeds it at max_exponent)
};

/// What FindExponent is asked. The vectors have n entries, -infinity for samples that do not count.
struct TemperingProblem {
  const Eigen::VectorXd& log_start;
  const Eigen::VectorXd& log_likelihood;
  double target = 0;        ///< effective number of samples wanted, (0, n]
  double max_exponent = 1;  ///< > 0, infinite for none
};

/// The largest exponent at which the effective number of samples is at least `target`: the sharpest
/// likelihood that leaves so many samples. With equal starting weights the ESS falls with the
/// exponent and the answer is unique. With others (proposal != prior) it has several humps
/// [Cheng 2019, Fig. 3], and the target may lie above all of them; then `reached` is false and the
/// exponent is that of the highest hump, or, where the supremum is only approached as the exponent
/// goes to zero (a posterior that ignores the data), the largest exponent whose ESS is the target's
/// share target / n of the ESS of the starting weights. A logarithmic grid (24 points per decade)
/// brackets, TOMS 748 refines to 1e-13 relative in the exponent; humps narrower than a grid step
/// can be missed. Where no sample has weight: max_exponent (1 where that is infinite), ess 0. Pure.
Tempering FindExponent(const TemperingProblem& problem);

}  // namespace calib::inference
