#pragma once
// Gaussian likelihood of the readings, factorised along the processing order.

#include <Eigen/Core>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "inference/data/data_set.h"

namespace calib::inference {

/// What the earlier readings leave open of a reading: the share of its error's variance that they
/// do not explain, the squared pivot of the correlation matrix in the order of readings.
struct OpenShare {
  Eigen::Index reading = 0;  ///< index of the reading
  double share = 1;          ///< (0, 1], or less where rounding leaves nothing
};

/// The share of each reading's error variance that the earlier readings must leave open for a
/// likelihood. Chosen: some hundred machine epsilons, below which the share is rounding.
inline constexpr double kLeastOpenShare = 1e-13;

/// The first reading of which the earlier ones leave no more than kLeastOpenShare open, else the
/// one of which they leave the least. Pure.
/// in: covariance T x T of the readings' errors, symmetric, its diagonal positive, T >= 1
OpenShare LeastOpenShare(const Eigen::MatrixXd& covariance);

/// ln p(y | x) of T readings y given predictions x, one independent block per (experiment,
/// observable) group g:
///   kGiven:    N(y_g; x_g, S_g),  S_ij = sd_i sd_j exp(-|c_i - c_j| / length) or as given in full,
///              with the proper |2 pi S|^(-1/2)
///   kInferred: N(y_g; x_g, f S_g) with f common to the groups of a NoiseGroup and integrated out
///              over its VarianceFactorPrior: a multivariate t density
///   kModelError: N(y_g; x_g, S_g) with each sd_i raised by the standard deviations of a
///   ModelError,
///              common to its members and integrated out over their prior by the levels of
///              CellsOf: a mixture of as many normal densities, at the cost of as many likelihoods
/// Written with S = L L^T and z = L^-1 (y - x), reading k of a group contributes a function of z_0
/// ... z_k alone (kInferred, kModelError: of all readings in common), its density conditional on
/// the earlier readings. Summed along the processing order the increments are the exact density
/// after every reading,
/// whatever the order [Cheng 2019, Eqs. 14 and 15, normaliser corrected]. Errors that are
/// correlated exponentially along a control that only grows (or falls) are a Markov chain: z_k
/// needs the reading before alone, and the cost is O(T); a covariance given in full costs O(T^2) a
/// sample. A row of predictions gives the same bits whatever other rows there are. Immutable after
/// Create; thread safety: const.
class GaussianLikelihood {
 public:
  /// The likelihood of `data`, of which it keeps no reference. noise: all but kEssTarget (for which
  /// pass WithRelativeErrors(data, sigma) and kGiven). Errors: INVALID_ARGUMENT from
  /// ValidateData, or when correlated readings lie so close that their covariance is singular.
  static absl::StatusOr<GaussianLikelihood> Create(const DataSet& data, NoiseMode noise);

  int readings() const { return readings_; }  ///< T

  /// ln p(y_t | earlier readings, x) of each reading t for each row of N x T predictions; N x T.
  /// NaN from the first prediction of an (experiment, observable) on that is not finite.
  Eigen::MatrixXd Increments(const Eigen::MatrixXd& predictions) const;

  /// Sum of each row of N x T increments in the order of readings, N entries; -infinity where one
  /// is NaN.
  static Eigen::VectorXd Sum(const Eigen::MatrixXd& increments);

  /// ln p(y | x) of each row of N x T predictions, N entries; -infinity where any prediction is not
  /// finite (a diverged sample).
  Eigen::VectorXd LogLikelihood(const Eigen::MatrixXd& predictions) const;

  /// ln p of the readings reached so far, those of each (experiment, observable) before its first
  /// prediction that is not finite, for each row of N x T predictions; N entries.
  Eigen::VectorXd ReachedLogLikelihood(const Eigen::MatrixXd& predictions) const;

  /// The largest value LogLikelihood can still take for each row of N x T predictions once those
  /// that are not finite yet arrive; N entries. Readings of an (experiment, observable) from the
  /// first missing one on are given zero residual given its past, z = 0: each increment is largest
  /// there, and with kInferred the marginal falls with every z^2, with kModelError that of each
  /// level.
  Eigen::VectorXd LogLikelihoodBound(const Eigen::MatrixXd& predictions) const;

  /// Posterior of the variance factors of G noise groups (NoiseGroupsOf), given each of N rows of
  /// predictions: that of group g is inverse gamma of shape shapes[g] and rate rates(i, g).
  struct FactorPosterior {
    Eigen::VectorXd shapes;  ///< G
    Eigen::MatrixXd rates;   ///< N x G; NaN where a prediction is not finite
  };
  /// The posterior of the variance factors for N x T predictions. For kInferred alone; no groups
  /// (G = 0) with kGiven.
  FactorPosterior VarianceFactors(const Eigen::MatrixXd& predictions) const;

  /// What is known of the model error of one of data.model_errors that has readings.
  struct ErrorLevels {
    std::size_t error = 0;  ///< index into data.model_errors
    ErrorCells cells{};     ///< their levels are those of log_posterior
    /// N x levels: ln of the prior mass of each level times p(its readings | x, level), readings
    /// reached alone.
    Eigen::MatrixXd log_joint{};
  };
  /// The model errors given each of N rows of predictions (N x T). For kModelError alone; none with
  /// another noise.
  std::vector<ErrorLevels> ModelErrors(const Eigen::MatrixXd& predictions) const;

 private:
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  struct Group {
    std::vector<int> readings;  // indices in processing order
    RowMajor cholesky;          // L, lower; empty: independent errors or a chain
  };
  // How a reading with independent errors or of a chain is whitened: L^-1 has entries for it and
  // the one before it alone, z = (r - carried r_previous) / pivot for residuals r.
  struct Link {
    int previous = -1;  // reading; -1: none
    double carried = 0;
    double inverse_pivot = 0;
  };
  struct FactorGroup {  // kInferred: readings that share a variance factor
    VarianceFactorPrior prior;
    std::vector<int> readings;     // indices in processing order
    Eigen::VectorXd log_constant;  // ln Gamma(shape + (k + 1) / 2) - ln Gamma(shape + k / 2)
  };
  struct LevelGroup {           // kModelError: readings that share a model error
    std::size_t error = 0;      // index into the data's
    std::vector<int> readings;  // indices in processing order
    ErrorCells cells;
    Eigen::VectorXd log_mass;              // by level
    Eigen::MatrixXd sd;                    // readings x levels
    std::vector<GaussianLikelihood> unit;  // one: of these readings, all zero with an sd of one
  };
  enum class Missing { kStop, kZeroResidual };

  using Rows = Eigen::Ref<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
  using MutableRows = Eigen::Ref<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
  // z, N x T; NaN where not reached, or zero residual there.
  void Whiten(const Rows& predictions, Missing missing, MutableRows z) const;
  // z of a group with a Cholesky factor; close(t) after each reading t, before later ones use it.
  void SubstituteForward(const Group& group, const Rows& predictions, MutableRows z,
                         absl::FunctionRef<void(int)> close) const;
  // z of a reading of a group without a Cholesky factor, up to where it is not finite.
  void WhitenLink(const Rows& predictions, int t, Eigen::Ref<Eigen::ArrayXd> z) const;
  Eigen::MatrixXd Fill(const Eigen::MatrixXd& predictions, Missing missing) const;
  void IntegrateFactor(const FactorGroup& group, MutableRows z) const;
  // Increments of the group's readings at a level; NaN where not reached, or zero residual there.
  Eigen::MatrixXd AtLevel(const LevelGroup& group, Eigen::Index level, const Rows& predictions,
                          Missing missing) const;
  void IntegrateLevels(const LevelGroup& group, const Rows& predictions, Missing missing,
                       MutableRows increments) const;
  absl::Status AddLevels(const DataSet& data);

  int readings_ = 0;
  bool inferred_ = false;
  bool is_plain_ = false;  // kGiven and no group with a Cholesky factor
  std::vector<double> values_;
  Eigen::VectorXd log_diagonal_;  // ln L_kk by reading
  std::vector<Link> links_;       // by reading
  std::vector<Group> groups_;
  std::vector<FactorGroup> factors_;  // kInferred alone
  std::vector<LevelGroup> levels_;    // kModelError alone
};

}  // namespace calib::inference
