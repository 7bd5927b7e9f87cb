#pragma once
// Smooth minimisation in a box, for a handful of variables such as the hyper-parameters of a
// Gaussian process.

#include <Eigen/Core>
#include <functional>

namespace calib::inference {

/// A function to minimise: returns its value at x (n entries) and writes its n derivatives to
/// `gradient`, which has the size of x. +infinity marks a point that cannot be evaluated; what
/// `gradient` holds is then not read.
using SmoothFunction = std::function<double(const Eigen::VectorXd& x, Eigen::VectorXd& gradient)>;

/// When MinimizeInBox stops. The defaults are chosen for functions whose variables and values have
/// order one, as a log density of logarithms has.
struct MinimizerOptions {
  int max_iterations = 50;  ///< >= 1
  /// > 0: it stops where every component of the projected gradient, or the decrease of the value in
  /// one step, is smaller.
  double tolerance = 1e-4;
};

/// What MinimizeInBox found.
struct Minimum {
  Eigen::VectorXd x;       ///< n, inside the box
  double value = 0;        ///< of the function there
  int iterations = 0;      ///< done
  bool converged = false;  ///< false: the iterations ran out, or no step went downhill
};

/// Local minimum in the box lower <= x <= upper by projected BFGS: variables at a bound that the
/// gradient pushes outwards are held, the quasi-Newton step of the others is cut back at the
/// bounds, Armijo's rule decides on its length.
///                                  [Bertsekas 1982; Nocedal & Wright 2006, sec. 3.1, 6.1 and 16.7]
/// Deterministic; thread safe where `function` is.
/// in: n entries each, lower <= start <= upper, all finite, function finite at start
Minimum MinimizeInBox(const SmoothFunction& function, const Eigen::VectorXd& start,
                      const Eigen::VectorXd& lower, const Eigen::VectorXd& upper,
                      const MinimizerOptions& options = {});

}  // namespace calib::inference
