#pragma once
// Variational Dirichlet-process mixture of Gaussians, fitted to weighted samples
// [Blei & Jordan 2006; Cheng 2019, sec. 3.5].

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "inference/mixture/gaussian_mixture.h"
#include "inference/mixture/variational_steps.h"

namespace calib::inference {

/// How FitDirichletMixture searches. Tolerance and covariance floor are scikit-learn's defaults;
/// iterations and starts are chosen: of scikit-learn's starts on the glass-bead ensemble, hundreds
/// of iterations each, seven in a hundred end near the best bound.
struct DirichletMixtureOptions {
  int max_components = 10;         ///< >= 1, truncation K [Cheng 2019: N/10]
  double concentration = 0.01;     ///< > 0, gamma (alpha of Cheng 2019); small: few components
  double covariance_floor = 1e-6;  ///< >= 0, squared units of the points: variance of a lone point
  double tolerance = 1e-3;         ///< > 0, change of the lower bound [nats] that ends a start
  int max_iterations = 1000;       ///< >= 1, of one start
  int restarts = 10;               ///< starts, >= 1; the largest bound wins, the earliest on a tie
  std::uint64_t seed = 0;  ///< starts draw from Philox streams (seed, kMixtureStart, stream, start)
  std::uint64_t stream = 0;       ///< tells fits by one seed apart, as the iterations of a filter
  absl::Status Validate() const;  ///< INVALID_ARGUMENT naming the field
};

/// A fitted mixture. A value; thread safety: const.
struct DirichletMixture {
  MixturePrior prior;
  MixtureState state;
  double lower_bound = 0;  ///< IterationBound at the end [nats, up to a constant of the data]
  int iterations = 0;      ///< E and M steps of the start that won
  bool converged = false;  ///< false: the iterations ran out

  /// Plug-in mixture: expected weights, means m_k, covariances C_k. Components of weight below
  /// `negligible` are left out, their share goes to the others.
  std::vector<MixtureComponent> PlugIn(double negligible = 0) const;
  /// The mixture with the covariances of the posterior predictive density, a Student t with
  /// nu_k + 1 - d degrees of freedom: C_k nu_k (1 + 1/beta_k) / max(nu_k - d - 1, 1). Wider than
  /// PlugIn by what few samples leave unknown about mean and covariance, hence safer to draw from.
  /// Components of weight below `negligible` are left out, their share goes to the others.
  ///                                                                [Bishop 2006, Eqs. 10.81-10.82]
  std::vector<MixtureComponent> Predictive(double negligible = 0) const;
};

/// E and M steps from given responsibilities (n x K) to convergence. Pure. Preconditions: valid
/// options, at least one point, counts that sum to more than one, a data covariance that is
/// positive definite.
DirichletMixture FitFrom(const WeightedPoints& data, const DirichletMixtureOptions& options,
                         const Eigen::MatrixXd& responsibilities);

/// The best mixture of options.restarts starts from k-means labels, largest cluster first: every
/// second start with K clusters, the others with K, K - 1, ... in turn, because optima with few
/// components are seldom reached by merging ten clusters. All starts run until the bound changes by
/// less than 0.1 nats, the best two of them on to options.tolerance. Pure.
/// Errors: INVALID_ARGUMENT for options, counts that are negative or not finite;
/// FAILED_PRECONDITION when the counts sum to one or less, or the points do not span all directions
/// (no covariance can be estimated).
absl::StatusOr<DirichletMixture> FitDirichletMixture(const WeightedPoints& data,
                                                     const DirichletMixtureOptions& options);

}  // namespace calib::inference
