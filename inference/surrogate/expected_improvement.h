#pragma once
// The next point of an expensive minimisation by expected improvement on a Gaussian process
// [Jones, Schonlau & Welch 1998], the alternative to the response surface's merit.

#include <Eigen/Core>
#include <optional>

#include "absl/status/statusor.h"
#include "inference/surrogate/response_surface.h"

namespace calib::inference {

/// Expected improvement E[max(best - f, 0)] of f ~ N(mean, sd^2) on the value `best`;
/// max(best - mean, 0) for sd = 0. Never negative. Pure.
///                                                           [Jones, Schonlau & Welch 1998, Eq. 15]
double ExpectedImprovement(double best, double mean, double sd);

/// The admissible point of the unit cube with the largest expected improvement, recorded as
/// pending; before that the initial design. The process is fitted to the values of all evaluations
/// done (to their logarithms where all are positive: misfits span decades) and passes within a
/// hundredth of the values' spread of each of them. The best value is the smallest mean of the
/// process at a point done, since values scatter. Pending evaluations count with the process's own
/// prediction there, the kriging believer [Ginsbourger et al. 2010], so that points chosen together
/// lie apart; terminated ones with that prediction, but no less than the value they were known to
/// exceed and than the best: a place that was tried promises nothing more. The maximum is looked
/// for among 2^11 scrambled Sobol points of the cube and as many perturbations of the best point,
/// and refined by ever smaller perturbations of the best candidate. Depends on the state alone.
/// nullopt: the budget is dispatched, or fewer than 2 d + 1 points are done yet and the design is
/// used up (wait). Errors: FAILED_PRECONDITION when no process can be fitted.
absl::StatusOr<std::optional<Eigen::VectorXd>> NextByExpectedImprovement(
    const ResponseSurfaceOptions& options, ResponseSurfaceState& state);

}  // namespace calib::inference
