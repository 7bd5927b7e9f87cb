#pragma once
// Likelihood of the readings with the emulator's error in the covariance.

#include <Eigen/Core>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/data/data_set.h"
#include "inference/emulator/state_emulator.h"

namespace calib::inference {

/// Density of T readings z, in units of their noise sd about the measured ones, under an emulator
/// of q components (StateEmulator):
///   N(z; mean + B m, F (R + diag(remainder)) + B D C D B^T),
///   D^2 = diag(sd^2 + share * scatter_sd^2)
/// with mean, basis B, remainder and error correlation C of the emulator, its prediction m, sd at a
/// point, the noise's correlation R (identity, exponential along the control, or as given in full),
/// and in F what multiplies the stated variances: one factor per noise group (kInferred), or by the
/// level of a model error another one for each reading (kModelError). `share` is the part of a
/// run's scatter that the measurement has as well. All that involves T is done once; a point then
/// costs O(q^3). Immutable after Create; thread safety: const.
class EmulatedLikelihood {
 public:
  /// How Create takes the data.
  struct Options {
    bool correlated_noise = true;  ///< false: as if the readings' errors were independent
    double scatter_share = 1;      ///< `share`, [0, 1]
    bool model_error = false;      ///< of the data, beside the stated errors (kModelError)
    bool reversed = false;  ///< the data are Reversed() ones of those the emulator learned from
  };
  /// The likelihood of the data under the emulator; keeps no reference.
  /// in: data that ValidateData accepts for kGiven; emulator of the same T readings
  /// Errors: INVALID_ARGUMENT when correlated readings lie so close that their covariance is
  /// singular.
  static absl::StatusOr<EmulatedLikelihood> Create(const DataSet& data,
                                                   const StateEmulator& emulator,
                                                   const Options& options);

  /// The likelihood of the first `readings` of the processing order alone, [0, T]; noise groups
  /// keep their places.
  EmulatedLikelihood First(Eigen::Index readings) const;

  /// The likelihood of these readings alone, ascending indices; noise groups keep their places.
  EmulatedLikelihood Of(const std::vector<Eigen::Index>& readings) const;

  /// ln p(readings | point) of the measured readings (z = 0) at m points, in the readings' own
  /// units, m entries. prediction: of the emulator at the points; noise: m x noise groups
  /// (NoiseGroupsOf), factors > 0 of the noise variance, or with model errors m x their number, the
  /// place of a level in their cells (CellsOf); 0 columns: as stated.
  Eigen::VectorXd LogLikelihood(const ScorePrediction& prediction,
                                const Eigen::MatrixXd& noise) const;

  /// chi^2 of the measured readings about the emulator's prediction at m points, by the covariance
  /// of the likelihood with all factors one, m entries; chi-squared distributed with T degrees of
  /// freedom over readings replicated from it.
  Eigen::VectorXd Misfit(const ScorePrediction& prediction) const;

  /// ln p(z | point) at the point `row` of a prediction for readings z (T, in units of their noise
  /// sd about the measured ones), all factors one.
  double LogDensity(const ScorePrediction& prediction, Eigen::Index row,
                    const Eigen::VectorXd& z) const;

 private:
  // What is known of the readings of one (experiment, observable), whitened by
  // W = chol(R + diag(remainder))^-1.
  struct Sums {
    Eigen::MatrixXd gram;        // B^T W^T W B
    Eigen::VectorXd projection;  // (W B)^T W r
    double square = 0;           // |W r|^2
    double log_normaliser = 0;   // minus the sum of ln sd + 1/2 ln 2 pi and of ln (W^-1)_kk
  };
  struct Form {
    std::vector<Eigen::Index> readings;
    int noise_group = 0;     // or model error; -1: none
    Eigen::MatrixXd larger;  // readings x levels of the model error: errors over stated ones
    std::vector<Sums> at_level;
    Eigen::MatrixXd whitening;       // W, lower
    Eigen::MatrixXd whitened_basis;  // W B
    Eigen::VectorXd log_sd;          // ln sd + 1/2 ln 2 pi of each reading
    Eigen::VectorXd log_pivots;      // ln (W^-1)_kk
    Eigen::VectorXd residual;        // W r, r the residual of the measured readings at m = 0
    Sums stated;                     // with the stated errors

    void Sum();  // what is summed over readings, from what there is for each
  };
  // W r at readings z.
  Eigen::VectorXd Whiten(const Form& form, const Eigen::VectorXd& z) const;
  struct Combined {
    double quadratic = 0;  // of chi^2, beside |W r|^2
    double log_determinant = 0;
    double LogDensity() const { return -0.5 * (quadratic + log_determinant); }
  };
  Combined Combine(const Eigen::VectorXd& mean, const Eigen::VectorXd& sd,
                   const Eigen::MatrixXd& gram, const Eigen::VectorXd& projection) const;

  Eigen::RowVectorXd mean_;
  Eigen::VectorXd scatter_variance_;    // share * scatter_sd^2
  Eigen::MatrixXd correlation_factor_;  // lower Cholesky factor of C
  std::vector<Form> forms_;
  bool model_error_ = false;
};

}  // namespace calib::inference
