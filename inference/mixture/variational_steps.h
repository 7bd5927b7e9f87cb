#pragma once
// The coordinate ascent behind the Dirichlet-process mixture: E step, M step, lower bounds. Plain
// values and pure functions; rho_nk, r_nk and the letters of priors and posteriors are those of
// [Bishop 2006, sec. 10.2].

#include <Eigen/Core>
#include <vector>

namespace calib::inference {

/// n samples in d dimensions, each with the number of observations it stands for. A count of three
/// is the same as three copies of the sample with count one.
struct WeightedPoints {
  Eigen::MatrixXd points;  ///< d x n, finite: a sample is a column
  Eigen::VectorXd counts;  ///< n, >= 0, with a sum above one
};

/// Gauss-Wishart priors of the components and stick-breaking prior of their weights.
///                                                     [Bishop 2006, sec. 10.2; Blei & Jordan 2006]
struct MixturePrior {
  double concentration = 0.01;     ///< gamma: each stick v_k ~ Beta(1, gamma)
  double mean_precision = 1;       ///< beta0
  double degrees_of_freedom = 1;   ///< nu0 >= d
  Eigen::VectorXd mean;            ///< m0, d
  Eigen::MatrixXd inverse_scale;   ///< W0^-1, d x d: expected covariance times nu0
  double covariance_floor = 1e-6;  ///< added to the variances of each component's samples
};

/// Prior from the data: m0 and W0^-1 are mean and sample covariance (divisor sum of counts - 1) of
/// the data, beta0 = 1, nu0 = d. What scikit-learn's BayesianGaussianMixture takes by default, so
/// that its results can be compared digit by digit. Precondition: counts that sum to more than one.
MixturePrior EmpiricalPrior(const WeightedPoints& data, double concentration,
                            double covariance_floor);

/// Variational posterior of K components in d dimensions:
///   v_k ~ Beta(a_k, b_k),  mu_k | L_k ~ N(m_k, (beta_k L_k)^-1),  L_k ~ Wishart(W_k, nu_k),
///   C_k = W_k^-1 / nu_k
struct MixtureState {
  Eigen::VectorXd a, b;                           ///< K: of the sticks v_k
  Eigen::VectorXd mean_precision;                 ///< K, beta_k
  Eigen::VectorXd degrees_of_freedom;             ///< K, nu_k
  Eigen::MatrixXd means;                          ///< d x K
  std::vector<Eigen::MatrixXd> covariances;       ///< K of d x d, C_k: plug-in covariance
  Eigen::Index size() const { return a.size(); }  ///< K
  /// Expected weights E v_k prod_{l<k} E(1 - v_l), renormalised over the K sticks.
  Eigen::VectorXd Weights() const;
};

/// Features of n points (d x n) in which quadratic forms of the points and their weighted moments
/// are linear, n x F, F = 1 + d + d (d + 1) / 2: 1, x_j, then x_j x_l by columns j >= l, of x =
/// point - origin. What cancels is of the order of the squared distance from the origin over the
/// smallest variance, times the machine epsilon; with the mean of the data as origin and the
/// covariance floor that is below 1e-9.
Eigen::MatrixXd QuadraticFeatures(const Eigen::MatrixXd& points, const Eigen::VectorXd& origin);

/// Lower Cholesky factors of the covariances C_k of a MixtureState and ln |C_k|, which E step and
/// bounds share.
struct CovarianceFactors {
  std::vector<Eigen::MatrixXd> lower;  ///< K of d x d
  Eigen::VectorXd log_determinant;     ///< K
};

/// The factors of the state's covariances. Precondition: they are positive definite.
CovarianceFactors FactorsOf(const MixtureState& state);

/// Coefficients, F x K, of ln rho_nk = E ln pi_k + E ln N(x_n; mu_k, L_k^-1) as a linear function
/// of QuadraticFeatures(x, origin). factors: of the state.
///                                                                         [Bishop 2006, Eq. 10.46]
Eigen::MatrixXd LogDensityCoefficients(const MixtureState& state, const CovarianceFactors& factors,
                                       const Eigen::VectorXd& origin);

/// What the E step gives for n points under K components.
struct Expectation {
  Eigen::MatrixXd responsibilities;  ///< n x K, r_nk: rho_nk normalised, rows sum to one
  Eigen::VectorXd log_density;       ///< n, ln sum_k rho_nk: scikit-learn's score_samples
};

/// E step at a state for points d x n.
Expectation EStep(const Eigen::MatrixXd& points, const MixtureState& state);

/// M step: the Gauss-Wishart and Beta posteriors given the moments sum_n c_n r_nk
/// QuadraticFeatures(x_n, prior.mean), F x K                        [Bishop 2006, Eqs. 10.51-10.63]
///   a_k = 1 + N_k, b_k = gamma + sum_{l>k} N_l,  N_k = sum_n c_n r_nk
///                                                                 [Blei & Jordan 2006, Eqs. 18-19]
/// N_k carries ten machine epsilons so that an empty component keeps its prior without a division
/// by zero.
MixtureState MStep(const MixturePrior& prior, const Eigen::MatrixXd& moments);

/// Evidence lower bound [nats] up to a constant of data and prior, valid right after the M step
/// that used responsibilities r_nk of this entropy, - sum_n c_n sum_k r_nk ln r_nk: cheap, watched
/// for convergence. Equals scikit-learn's lower_bound_. factors: of the state.
double IterationBound(const MixtureState& state, const CovarianceFactors& factors, double entropy);

/// The complete evidence lower bound [nats] at a state with its own E step:
///   sum_n c_n ln sum_k rho_nk - sum_k KL(Beta) - sum_k KL(Gauss-Wishart)
///                                                                         [Bishop 2006, Eq. 10.70]
double EvidenceLowerBound(const WeightedPoints& data, const MixturePrior& prior,
                          const MixtureState& state);

}  // namespace calib::inference
