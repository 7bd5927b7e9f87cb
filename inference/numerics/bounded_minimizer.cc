#include "inference/numerics/bounded_minimizer.h"

#include <cassert>
#include <cmath>
#include <vector>

namespace calib::inference {
namespace {

using Eigen::Index;

// Share of the slope that a step must go down by [Nocedal & Wright 2006, sec. 3.1].
constexpr double kArmijo = 1e-4;
constexpr double kCut = 0.4;   // chosen: factor on a step that goes down by less
constexpr int kMostCuts = 20;  // chosen: to 1e-8 of the first step
// Cosine between step and change of the gradient below which the curvature along the step is
// rounding; chosen.
constexpr double kLeastCurvature = 1e-10;

// Variables that may move: not at a bound, or pulled back inside by the gradient.
std::vector<Index> FreeVariables(const Eigen::VectorXd& x, const Eigen::VectorXd& gradient,
                                 const Eigen::VectorXd& lower, const Eigen::VectorXd& upper) {
  std::vector<Index> free;
  for (Index j = 0; j < x.size(); ++j) {
    const bool held =
        (x[j] <= lower[j] && gradient[j] > 0) || (x[j] >= upper[j] && gradient[j] < 0);
    if (!held) free.push_back(j);
  }
  return free;
}

// Quasi-Newton direction among the free variables; zero for the others.
Eigen::VectorXd Direction(const Eigen::MatrixXd& inverse_hessian, const Eigen::VectorXd& gradient,
                          const std::vector<Index>& free) {
  Eigen::VectorXd direction = Eigen::VectorXd::Zero(gradient.size());
  for (const Index i : free) {
    for (const Index j : free) direction[i] -= inverse_hessian(i, j) * gradient[j];
  }
  return direction;
}

// BFGS update of the inverse Hessian [Nocedal & Wright 2006, Eq. 6.17], skipped where the curvature
// is not positive.
void Update(const Eigen::VectorXd& step, const Eigen::VectorXd& change, bool first,
            Eigen::MatrixXd& inverse_hessian) {
  const double curvature = step.dot(change);
  if (!(curvature > kLeastCurvature * step.norm() * change.norm())) return;
  const Index n = step.size();
  if (first) inverse_hessian = Eigen::MatrixXd::Identity(n, n) * (curvature / change.squaredNorm());
  const Eigen::MatrixXd left =
      Eigen::MatrixXd::Identity(n, n) - step * change.transpose() / curvature;
  inverse_hessian =
      (left * inverse_hessian * left.transpose() + step * step.transpose() / curvature).eval();
}

}  // namespace

Minimum MinimizeInBox(const SmoothFunction& function, const Eigen::VectorXd& start,
                      const Eigen::VectorXd& lower, const Eigen::VectorXd& upper,
                      const MinimizerOptions& options) {
  const Index n = start.size();
  Minimum best{.x = start};
  Eigen::VectorXd gradient(n);
  Eigen::VectorXd trial_gradient(n);
  best.value = function(best.x, gradient);
  assert(std::isfinite(best.value));
  Eigen::MatrixXd inverse_hessian = Eigen::MatrixXd::Identity(n, n);
  bool first = true;
  while (best.iterations < options.max_iterations) {
    ++best.iterations;
    const std::vector<Index> free = FreeVariables(best.x, gradient, lower, upper);
    double largest = 0;
    for (const Index j : free) largest = std::max(largest, std::abs(gradient[j]));
    if (largest < options.tolerance) {
      best.converged = true;
      break;
    }
    Eigen::VectorXd direction = Direction(inverse_hessian, gradient, free);
    if (direction.dot(gradient) >= 0) {  // the held variables spoiled the metric: start it again
      inverse_hessian.setIdentity();
      direction = Direction(inverse_hessian, gradient, free);
    }
    if (first) direction *= std::min(1.0, 1 / largest);  // no scale known yet: at most a unit step

    bool found = false;
    double length = 1;
    for (int cut = 0; cut < kMostCuts; ++cut, length *= kCut) {
      const Eigen::VectorXd x = (best.x + length * direction).cwiseMax(lower).cwiseMin(upper);
      const double value = function(x, trial_gradient);
      if (!(value <= best.value + kArmijo * gradient.dot(x - best.x))) continue;
      const double decrease = best.value - value;
      Update(x - best.x, trial_gradient - gradient, first, inverse_hessian);
      first = false;
      best.x = x;
      best.value = value;
      gradient = trial_gradient;
      found = true;
      best.converged = decrease < options.tolerance;
      break;
    }
    if (!found || best.converged) break;
  }
  return best;
}

}  // namespace calib::inference
