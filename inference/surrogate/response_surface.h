#pragma once
// Minimisation of an expensive function by the metric stochastic response surface method, local
// version, asynchronous and with early termination
// [Regis & Shoemaker 2007; Samuelsson 2023, Alg. 3-5].

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "inference/sampling/philox.h"
#include "inference/surrogate/cubic_rbf.h"

namespace calib::inference {

/// Options of a minimisation over the unit cube; defaults of [Samuelsson 2023, Table 4.2].
struct ResponseSurfaceOptions {
  int dimensions = 0;        ///< d >= 1
  int max_evaluations = 40;  ///< N_max, all dispatched runs together
  int workers = 1;           ///< P >= 1
  int initial_points = 0;    ///< of the initial design, >= 2 d + 1; 0: 2 d + 1 + P
  /// m x d in the unit cube: the first points of the initial design; a symmetric Latin hypercube of
  /// the others, at least two, follows. 0 x 0: the hypercube is the design.
  Eigen::MatrixXd first_points = {};
  int candidates = 0;           ///< t for each point chosen; 0: 100 d
  double max_step = 0.2;        ///< sigma_max, the first step size, (0, 1]
  double min_step = 0.2 / 64;   ///< sigma_min, (0, max_step]
  int successes_to_double = 3;  ///< C_success >= 1: improvements in a row that double the step
  int failures_to_halve = 4;    ///< C_fail >= 1: evaluations without one that halve it
  /// MeritOptions::weight of the points chosen one after the other, in turn; each in [0, 1].
  std::vector<double> weights = {0.3, 0.5, 0.8, 0.95};
  double min_distance = 1e-3;  ///< MeritOptions::min_distance, [1e-6, 1)
  /// Which points of the cube are admissible; empty: all. Never called concurrently.
  std::function<bool(const Eigen::VectorXd&)> admissible = {};
  /// a > 0: the factor c of TerminationBound is a in the first half of the evaluations after the
  /// initial design, a/2 in the third quarter, a/4 in the last.
  double termination = 10;
  std::uint64_t seed = 0;
  absl::Status Validate() const;  ///< INVALID_ARGUMENT: field, what was found, what is allowed
};

/// An admissible point of the cube near `center`, which is one: each coordinate moved by `step`
/// times a normal number and cut off at the faces, so that an optimum on a face can be met exactly;
/// drawn again where not admissible, ever closer, at last the center itself.
Eigen::VectorXd Perturbed(const ResponseSurfaceOptions& options, const Eigen::VectorXd& center,
                          double step, PhiloxStream& stream);

/// What has become of a point that was chosen.
enum class EvaluationStatus {
  kPending,     ///< dispatched; further points keep their distance
  kDone,        ///< it has a value, which the surrogate interpolates
  kTerminated,  ///< stopped early or failed; further points keep their distance
};

/// A point that was chosen, and its value once there is one.
struct Evaluation {
  Eigen::VectorXd point;  ///< in [0, 1]^d
  EvaluationStatus status = EvaluationStatus::kPending;
  double value = 0;  ///< of the function, with kDone alone
  /// With kTerminated: what the value would have been at least, where that is known.
  std::optional<double> at_least = {};
};

/// Everything an optimisation is at one moment; plain values, to be stored and resumed. The
/// evaluation's index is its id.
struct ResponseSurfaceState {
  Eigen::MatrixXd design;               ///< initial points, m x d; row k is evaluation k
  std::vector<Evaluation> evaluations;  ///< in the order they were dispatched
  std::vector<int> completed;           ///< ids of those done, in the order their values came
  double step = 0;                      ///< sigma_n, of the perturbations
  int successes = 0;                    ///< improvements in a row
  int failures = 0;                     ///< evaluations without improvement in a row
  int best = -1;                        ///< index of the smallest value, -1: none yet
};

/// Begins a minimisation: its design are the options' first points and a symmetric Latin hypercube,
/// of 1000 the one whose closest points lie farthest apart, that determine a linear function
/// together; points that are not admissible are replaced by uniform draws that are. Errors:
/// INVALID_ARGUMENT from Validate; FAILED_PRECONDITION when next to nothing is admissible.
absl::StatusOr<ResponseSurfaceState> StartResponseSurface(const ResponseSurfaceOptions& options);

/// The next point to evaluate, recorded as pending; its id is state.evaluations.size() - 1. First
/// the initial design, then the best of `candidates` admissible normal perturbations of the best
/// point by the merit, weights cycling. Depends on the state alone, whatever the order in which
/// pending evaluations finish afterwards. surrogate: kept by the caller between calls so that each
/// new value costs O(n^2); brought up to date here from state.completed. A new one gives the same
/// bits, at O(n^3). nullopt: the budget is dispatched, or fewer than 2 d + 1 points are done yet
/// and the design is used up (wait).
std::optional<Eigen::VectorXd> NextPoint(const ResponseSurfaceOptions& options,
                                         ResponseSurfaceState& state, CubicRbf& surrogate);

/// Takes the result of a pending evaluation: its value, or nullopt when it was stopped early or
/// failed; at_least: what the value of one stopped early would have been at least. Adapts the step:
/// doubled after C_success improvements in a row, halved after C_fail evaluations in a row without
/// one (terminated ones among them); the initial design does not count. Errors: INVALID_ARGUMENT
/// for an id that is not pending or a value or bound that is not finite.
absl::Status Report(const ResponseSurfaceOptions& options, int id, std::optional<double> value,
                    ResponseSurfaceState& state, std::optional<double> at_least = {});

/// The bound c f* above which the early error of the running evaluation `id` ends it, f* the best
/// value so far; +infinity for the initial design and while nothing is done. Not a rigorous bound
/// unless the early error is part of the objective and c >= 1.          [Samuelsson 2023, Eq. 3.4]
double TerminationBound(const ResponseSurfaceOptions& options, int id,
                        const ResponseSurfaceState& state);

}  // namespace calib::inference
