#pragma once
// The exponent of the likelihood that gives a wanted effective sample size.

#include <Eigen/Core>

namespace calib::inference {

/// Weights w_i ∝ exp(log_start_i + exponent * log_likelihood_i).
struct Tempering {
  double exponent = 1;   ///< in (0, max_exponent]
  double ess = 0;        ///< effective number of samples there
  bool reached = false;  ///< ess equals the target (or exceeds it at max_exponent)
};

/// The largest exponent at which the effective number of samples is at least `target`: the sharpest
/// likelihood that leaves so many samples. With equal starting weights the ESS falls with the
/// exponent and the answer is unique. With others (proposal != prior) it has several humps [Cheng
/// 2019, Fig. 3], and the target may lie above all of them; then `reached` is false and the
/// exponent is that of the highest hump, or, where the supremum is only approached as the exponent
/// goes to zero (a posterior that ignores the data), the largest exponent whose ESS is the target's
/// share target / n of the ESS of the starting weights. A logarithmic grid (24 points per decade)
/// brackets, TOMS 748 refines to 1e-13 relative in the exponent; humps narrower than a grid step
/// can be missed.
/// in:  log_start, log_likelihood of equal size n, -inf for samples that do not count;
///      target in (0, n]; max_exponent > 0, infinite for none
/// out: when no sample has weight, or fewer than target have: the exponent as above with `reached`
///      false
struct TemperingProblem {
  const Eigen::VectorXd& log_start;
  const Eigen::VectorXd& log_likelihood;
  double target = 0;
  double max_exponent = 1;
};
Tempering FindExponent(const TemperingProblem& problem);

}  // namespace calib::inference
