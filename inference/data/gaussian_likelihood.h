#pragma once
// Gaussian likelihood of the readings, factorised along the processing order.

#include <Eigen/Core>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "inference/data/data_set.h"

namespace calib::inference {

/// What the earlier readings leave open of a reading: the share of its error's variance that they
/// do not explain, the pivot of the correlation matrix in the order of readings.
struct OpenShare {
  Eigen::Index reading = 0;
  double share = 1;
};
/// A likelihood needs more than this of each.
inline constexpr double kLeastOpenShare = 1e-13;

/// The first reading of which no more than kLeastOpenShare is left open, else the one of which the
/// least is.
/// in: covariance, symmetric, its diagonal positive, at least one reading
OpenShare LeastOpenShare(const Eigen::MatrixXd& covariance);

/// ln p(y | x) of readings y given predictions x, one independent block per (experiment,
/// observable) group g:
///   kGiven:    N(y_g; x_g, S_g),  S_ij = sd_i sd_j exp(-|c_i - c_j| / length),
///              with the proper |2 pi S|^(-1/2)
///   kInferred: the same with f S_g, f common to the groups of a NoiseGroup and integrated out over
///              its VarianceFactorPrior: a multivariate t density
/// Written with S = L L^T and z = L^-1 (y - x), reading k of a group contributes a function of z_0
/// ... z_k alone (kInferred: of the noise group), its density conditional on the earlier readings.
/// Summed along the processing order the increments are the exact density after every reading,
/// whatever the order [Cheng 2019, Eq. 14 and 15, normaliser corrected]. Errors that are correlated
/// exponentially along a control that only grows (or falls) are a Markov chain: z_k needs the
/// reading before alone, and the cost is O(T); a covariance given in full costs O(T^2) a sample.
/// Thread safety: const after Create.
class GaussianLikelihood {
 public:
  /// noise: kGiven or kInferred (kEssTarget: pass WithRelativeErrors(data, sigma) and kGiven).
  /// Errors: INVALID_ARGUMENT from ValidateData, or when correlated readings lie so close that
  /// their covariance is singular.
  static absl::StatusOr<GaussianLikelihood> Create(const DataSet& data, NoiseMode noise);

  int readings() const { return readings_; }

  /// N x T increments from N x T predictions. From the first prediction of an (experiment,
  /// observable) that is not finite on, its increments are NaN.
  Eigen::MatrixXd Increments(const Eigen::MatrixXd& predictions) const;

  /// Sum of each row of increments in the order of readings, N; -inf where one is NaN.
  static Eigen::VectorXd Sum(const Eigen::MatrixXd& increments);

  /// ln p(y | x) of each row, N; -inf where any prediction is not finite (a diverged sample).
  Eigen::VectorXd LogLikelihood(const Eigen::MatrixXd& predictions) const;

  /// ln p of the readings reached so far: those of each group before its first prediction that is
  /// not finite. N.
  Eigen::VectorXd ReachedLogLikelihood(const Eigen::MatrixXd& predictions) const;

  /// The largest value LogLikelihood can still take once the predictions that are not finite yet
  /// arrive: those of a group from the first missing one on have zero residual given its past,
  /// z = 0. N. Sound because each increment is largest at z = 0, and with kInferred the marginal
  /// falls with every z^2.
  Eigen::VectorXd LogLikelihoodBound(const Eigen::MatrixXd& predictions) const;

  /// kInferred: given x the variance factor of noise group g (NoiseGroupsOf) is inverse gamma of
  /// shape shapes[g] and rate rates(i, g). NaN rates where a prediction is not finite.
  struct FactorPosterior {
    Eigen::VectorXd shapes;  ///< G
    Eigen::MatrixXd rates;   ///< N x G
  };
  FactorPosterior VarianceFactors(const Eigen::MatrixXd& predictions) const;

 private:
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  struct Group {
    std::vector<int> readings;  // indices in processing order
    RowMajor cholesky;          // L, lower; empty: independent errors or a chain
  };
  /// Of independent errors and chains: L^-1 has entries for a reading and the one before it alone,
  /// z = (r - carried r_previous) / pivot for residuals r.
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

  int readings_ = 0;
  bool inferred_ = false;
  bool is_plain_ = false;  // kGiven and no group with a Cholesky factor
  std::vector<double> values_;
  Eigen::VectorXd log_diagonal_;  // ln L_kk by reading
  std::vector<Link> links_;       // by reading
  std::vector<Group> groups_;
  std::vector<FactorGroup> factors_;  // empty: kGiven
};

}  // namespace calib::inference
