#pragma once
// Prior of all parameters together: marginals, tied by a Gaussian copula and cut by linear
// constraints where the user says so.

#include <Eigen/Core>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/prior/prior.h"
#include "inference/sampling/philox.h"

namespace calib::inference {

/// coefficients . x <= limit, in the units of the parameters.
struct LinearConstraint {
  Eigen::VectorXd coefficients;  ///< d
  double limit = 0;
};

/// p(x) = c(z) prod_j p_j(x_j) [A x <= b] / mass, with z_j = Phi^-1(F_j(x_j)) the normal score of
/// x_j in its marginal and c the density of the Gaussian copula,
///   ln c(z) = -1/2 ln |R| - 1/2 z^T (R^-1 - I) z                                [Song 2000, Eq. 5]
/// `mass` is the share of the unconstrained prior inside the constraints. Normal and log-normal
/// marginals without bounds make a multivariate normal (of ln x for the log kind) of correlation R;
/// a constraint changes the marginals, R is that of the prior before the cut.
/// A value; thread safety: const.
class JointPrior {
 public:
  JointPrior() = default;
  /// Independent marginals, as most calls have them.
  JointPrior(std::vector<Prior> marginals)  // NOLINT(google-explicit-constructor)
      : marginals_(std::move(marginals)) {}
  JointPrior(std::span<const Prior> marginals)  // NOLINT(google-explicit-constructor)
      : marginals_(marginals.begin(), marginals.end()) {}

  /// correlation: d x d of the normal scores, unit diagonal; 0 x 0: independent. Errors:
  /// INVALID_ARGUMENT with one sentence for a marginal that Validate refuses, a correlation that is
  /// not symmetric positive definite, constraints of another size, or constraints that leave less
  /// than 1e-4 of the prior (the empty prior among them).
  static absl::StatusOr<JointPrior> Create(std::vector<Prior> marginals,
                                           Eigen::MatrixXd correlation,
                                           std::vector<LinearConstraint> constraints);

  std::size_t size() const { return marginals_.size(); }
  bool empty() const { return marginals_.empty(); }
  const Prior& operator[](std::size_t j) const { return marginals_[j]; }
  std::vector<Prior>::const_iterator begin() const { return marginals_.begin(); }
  std::vector<Prior>::const_iterator end() const { return marginals_.end(); }
  bool is_independent() const { return correlation_.size() == 0; }
  bool is_constrained() const { return !constraints_.empty(); }
  const Eigen::MatrixXd& correlation() const { return correlation_; }

  /// ln of the share of the prior inside the constraints, and the standard error of that share over
  /// itself: from 16 scrambled Sobol sets, doubled until the error is below 1e-3 or they hold 2^19
  /// points. 0 and 0 without constraints.
  double log_mass() const { return log_mass_; }
  double mass_error() const { return mass_error_; }

  absl::Status Validate() const;
  /// x: d, each in its own unit.
  bool InSupport(const Eigen::VectorXd& x) const;
  bool MeetsConstraints(const Eigen::VectorXd& x) const;
  /// ln p(x); -inf outside the support.
  double LogDensity(const Eigen::VectorXd& x) const;
  /// The same per unit of the standardised coordinates (Prior::ToStandard).
  double LogStandardDensity(const Eigen::VectorXd& x) const;

  Eigen::VectorXd ToStandard(const Eigen::VectorXd& x) const;
  Eigen::VectorXd FromStandard(const Eigen::VectorXd& s) const;

  /// Point of the unit cube (0, 1)^d to the prior without its constraints: z = L Phi^-1(u),
  /// x_j = F_j^-1(Phi(z_j)), L L^T = R; quantiles of the marginals where they are independent.
  Eigen::VectorXd FromUnit(const Eigen::VectorXd& u) const;
  /// One draw: points of the unit cube from the stream until one meets the constraints.
  Eigen::VectorXd Draw(PhiloxStream& stream) const;

  /// The prior with further parameters, independent of these and of each other, behind it.
  JointPrior With(std::span<const Prior> further) const;
  /// The prior of some of the parameters, ascending indices. Precondition: independent and
  /// unconstrained.
  JointPrior Of(std::span<const Eigen::Index> indices) const;

 private:
  double LogCopula(const Eigen::VectorXd& x) const;
  void MeasureMass();

  std::vector<Prior> marginals_;
  Eigen::MatrixXd correlation_;                // of all marginals or of the first ones (With)
  Eigen::MatrixXd cholesky_;                   // lower
  double log_determinant_ = 0;                 // of R
  std::vector<LinearConstraint> constraints_;  // on the first ones likewise
  double log_mass_ = 0;
  double mass_error_ = 0;
};

}  // namespace calib::inference
