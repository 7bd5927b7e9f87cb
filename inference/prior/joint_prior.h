#pragma once
// Prior of all parameters together: marginals, tied by a Gaussian copula and cut by linear
// constraints where the user says so.

#include <Eigen/Core>
#include <limits>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/prior/prior.h"
#include "inference/sampling/philox.h"

namespace calib::inference {

/// A half-space of parameters: coefficients . x <= limit, in the units of the parameters.
struct LinearConstraint {
  Eigen::VectorXd coefficients;  ///< d, finite
  double limit = 0;
};

/// Bounds of a value of a population, x[common] + x[spread] x[score]: the member of a hierarchical
/// model in the coordinates in which its parts are independent [Betancourt & Girolami 2015].
struct MemberBounds {
  Eigen::Index common = 0, spread = 0, score = 0;         ///< indices of parameters
  double min = -std::numeric_limits<double>::infinity();  ///< <= max, in the parameter's unit
  double max = std::numeric_limits<double>::infinity();
};

/// Prior of d parameters, p(x) = c(z) prod_j p_j(x_j) [A x <= b] / mass, with z_j =
/// Phi^-1(F_j(x_j)) the normal score of x_j in its marginal and c the density of the Gaussian
/// copula
///   ln c(z) = -1/2 ln |R| - 1/2 z^T (R^-1 - I) z                                [Song 2000, Eq. 5]
/// `mass` is the share of the unconstrained prior inside the constraints and the bounds of members.
/// Normal and log-normal marginals without bounds make a multivariate normal (of ln x for the log
/// kind) of correlation R; a constraint changes the marginals, R is that of the prior before the
/// cut. A value; thread safety: const.
class JointPrior {
 public:
  JointPrior() = default;
  /// A prior of independent marginals without constraints; a list of them converts to it.
  JointPrior(std::vector<Prior> marginals)  // NOLINT(google-explicit-constructor)
      : marginals_(std::move(marginals)) {}
  JointPrior(std::span<const Prior> marginals)  // NOLINT(google-explicit-constructor)
      : marginals_(marginals.begin(), marginals.end()) {}

  /// A prior with correlation and constraints. correlation: d x d of the normal scores, unit
  /// diagonal; 0 x 0: independent. Errors: INVALID_ARGUMENT with one sentence for a marginal that
  /// Prior::Validate refuses, a correlation that is not symmetric positive definite, constraints of
  /// another size, members of parameters that are none, or constraints and members that leave less
  /// than 1e-4 of the prior (an empty prior too).
  static absl::StatusOr<JointPrior> Create(std::vector<Prior> marginals,
                                           Eigen::MatrixXd correlation,
                                           std::vector<LinearConstraint> constraints,
                                           std::vector<MemberBounds> members = {});

  std::size_t size() const { return marginals_.size(); }  ///< d
  bool empty() const { return marginals_.empty(); }
  const Prior& operator[](std::size_t j) const { return marginals_[j]; }
  std::vector<Prior>::const_iterator begin() const { return marginals_.begin(); }
  std::vector<Prior>::const_iterator end() const { return marginals_.end(); }
  bool is_independent() const { return correlation_.size() == 0; }
  /// By constraints or by bounds of members.
  bool is_constrained() const { return !constraints_.empty() || !members_.empty(); }
  /// R, of the normal scores of the first parameters (all, unless With added some); 0 x 0:
  /// independent.
  const Eigen::MatrixXd& correlation() const { return correlation_; }

  /// ln of the share of the prior inside the constraints, 0 without any: from 16 scrambled Sobol
  /// sets, doubled until mass_error() is below 1e-3 or they hold 2^19 points together.
  double log_mass() const { return log_mass_; }
  /// Standard error of the share of the prior inside the constraints, over that share; 0 without
  /// any.
  double mass_error() const { return mass_error_; }

  /// INVALID_ARGUMENT of the first marginal that Prior::Validate refuses.
  absl::Status Validate() const;
  /// Whether x (d, in the parameters' units) is inside all marginals' bounds and meets the
  /// constraints.
  bool InSupport(const Eigen::VectorXd& x) const;
  /// Whether x (d, in the parameters' units) meets the constraints and the bounds of members.
  bool MeetsConstraints(const Eigen::VectorXd& x) const;
  /// ln p(x), per unit of the parameters; -infinity outside the support.
  double LogDensity(const Eigen::VectorXd& x) const;
  /// ln p(x), per unit of the standardised coordinates (Prior::ToStandard); -infinity outside the
  /// support.
  double LogStandardDensity(const Eigen::VectorXd& x) const;

  /// Standardised coordinates (Prior::ToStandard) of the parameters x, d entries.
  Eigen::VectorXd ToStandard(const Eigen::VectorXd& x) const;
  /// Parameters of the standardised coordinates s, d entries.
  Eigen::VectorXd FromStandard(const Eigen::VectorXd& s) const;

  /// Takes a point u of the unit cube (0, 1)^d to the prior without its constraints, so that a
  /// uniform u gives a draw: x_j = F_j^-1(Phi(z_j)), z = L Phi^-1(u), L L^T = R; F_j^-1(u_j) where
  /// the parameters are independent.
  Eigen::VectorXd FromUnit(const Eigen::VectorXd& u) const;
  /// One draw of the prior: points of the unit cube from the stream until one meets the
  /// constraints.
  Eigen::VectorXd Draw(PhiloxStream& stream) const;

  /// This prior with further parameters behind its own, independent of them and of each other.
  JointPrior With(std::span<const Prior> further) const;
  /// The prior of some of the parameters alone, ascending indices. Precondition: independent and
  /// unconstrained.
  JointPrior Of(std::span<const Eigen::Index> indices) const;

 private:
  double LogCopula(const Eigen::VectorXd& x) const;
  void MeasureMass();

  std::vector<Prior> marginals_;
  Eigen::MatrixXd correlation_;                // of all marginals or of the first ones (With)
  Eigen::MatrixXd cholesky_;                   // lower
  double log_determinant_ = 0;                 // of R
  std::vector<LinearConstraint> constraints_;  // on the first parameters
  std::vector<MemberBounds> members_;
  double log_mass_ = 0;
  double mass_error_ = 0;
};

}  // namespace calib::inference
