#pragma once
// Smooth minimisation in a box, for the handful of hyper-parameters of an emulator.

#include <Eigen/Core>
#include <functional>

namespace calib::inference {

/// Value at x and, written to `gradient` (same size), its derivatives. +inf marks points that
/// cannot be evaluated.
using SmoothFunction = std::function<double(const Eigen::VectorXd& x, Eigen::VectorXd& gradient)>;

struct MinimizerOptions {
  int max_iterations = 50;  ///< >= 1
  double tolerance =
      1e-4;  ///< stops where the projected gradient or the decrease in one step is smaller
};

struct Minimum {
  Eigen::VectorXd x;
  double value = 0;
  int iterations = 0;
  bool converged = false;
};

/// Projected BFGS [Bertsekas 1982; Nocedal & Wright 2006, sec. 6.1 and 16.7]: variables at a bound
/// that the gradient pushes outwards are held, the quasi-Newton step of the others is cut back at
/// the bounds, Armijo's rule decides on its length. Deterministic.
/// in: lower <= start <= upper, all finite, function finite at start
Minimum MinimizeInBox(const SmoothFunction& function, const Eigen::VectorXd& start,
                      const Eigen::VectorXd& lower, const Eigen::VectorXd& upper,
                      const MinimizerOptions& options = {});

}  // namespace calib::inference
