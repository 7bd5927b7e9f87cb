#pragma once
// Model against measurements: where the posterior mean fits and where it does not, in units of the
// stated errors and of the scatter of packings.

#include <optional>
#include <string>
#include <vector>

#include "server/report/views/campaign_view.h"
#include "server/report/views/parameter_drift.h"
#include "server/report/views/predictions.h"
#include "server/report/views/prior_conflict.h"
#include "server/report/views/residual_pattern.h"

namespace calib::report {

struct ObservableMisfit {
  std::string experiment, observable;
  bool heldout = false;  ///< a validation experiment's: never used for fitting
  int readings = 0;
  double rms_error = 0;        ///< rms of residual / sd of noise and packing scatter together
  double rms_residual = 0;     ///< rms of residual [SI]
  double scatter = 0;          ///< rms of the scatter's sd over that of the noise; 0: none is known
  std::string scatter_from{};  ///< realizations | repeats (twins) | emulator; empty: none is known
  std::optional<double>
      z;  ///< chi-squared of the group as a standard normal deviate (inference::NormalDeviate)
  /// Probability of a chi-squared at least as large if the model is right, scatter known from the
  /// packings or twins that were run (inference::UpperTail): predictive_p, else at the posterior
  /// mean. That is too large by as many degrees of freedom as the parameters take of these
  /// readings. Of held-out readings the errors of the prediction are among those of the residuals.
  std::optional<double> p_value{};
  std::optional<double>
      predictive_p{};  ///< over draws of the posterior, fitted readings: the record's
  /// Independent readings that would fix the mean of the residual as well: n^2 / sum of the
  /// correlations of the errors.
  double effective_readings = 0;
  ResidualPattern pattern = {};  ///< over all stages; none where the errors are not known
};

struct SegmentMisfit {
  std::string experiment, observable, segment;
  bool heldout = false;
  double from = 0, to = 0;  ///< control at the first and last reading (strain [-] or stress [Pa])
  double bias = 0;          ///< mean of model minus measurement [SI]
  std::optional<double>
      z;  ///< bias over its standard deviation, correlation of the errors included, as a standard
          ///< normal deviate (inference::NormalDeviateOfMean)
  std::optional<double> p_value{};       ///< as ObservableMisfit::p_value, of this stage alone
  std::optional<double> predictive_p{};  ///< as ObservableMisfit::predictive_p
  int readings = 0;
  double effective_readings = 0;  ///< as ObservableMisfit::effective_readings
  double rms_error = 0;           ///< rms of residual / standard deviation
  /// Share of the chi-squared of everything fitted, or of everything held out.
  std::optional<double> chi2_share;
  ResidualPattern pattern = {};  ///< none where the errors are not known
};

/// The bias of an observable in one stage over experiments that differ in a setting.
struct BiasTrend {
  std::string observable, segment;
  std::string with;       ///< confining_pressure, loading_rate, ...
  double per_decade = 0;  ///< change of the bias per factor ten in it [SI]
  double z = 0;           ///< over its standard deviation
};

/// What stays unexplained of an observable along the path of an experiment, beyond noise and
/// scatter: a smooth process [Kennedy & O'Hagan 2001]. SI; model - measurement.
struct ObservableDiscrepancy {
  std::string experiment, observable, control_name;
  bool heldout = false;          ///< expected of it from the fitted experiments
  double probability = 0;        ///< that there is one
  double log_bayes_factor = 0;   ///< for one, of all experiments of the observable together
  double amplitude = 0;          ///< root mean square of `mean`
  double length = 0;             ///< stretch of the control over which it changes
  bool throughout = false;       ///< that is more than the whole path
  int experiments = 1;           ///< from which it is known
  double alike = 0;              ///< correlation between their discrepancies, [0, 1)
  std::vector<double> mean, sd;  ///< one per reading
  std::size_t largest = 0;       ///< reading with the largest mean
  double largest_at = 0;         ///< its control
  std::string segment{};         ///< its loading stage
};

struct Comparison {
  double rms_error = 0;  ///< over all calibrated readings; NaN: nothing to compare yet
  std::optional<double> reduced_chi2;  ///< chi-squared / (readings - parameters)
  std::optional<double> p_value;
  /// Probability of a larger chi-squared in a replicate at draws from the posterior, over all
  /// fitted data, as the posterior's record has it.
  std::optional<double> predictive_p{};
  std::optional<double> heldout_rms_error;  ///< over all validation readings
  std::vector<ObservableMisfit> by_observable;
  std::vector<SegmentMisfit> by_segment;
  std::vector<BiasTrend> trends;      ///< those beyond 3 sd, calibrated experiments only
  std::vector<std::string> at_bound;  ///< parameters pressed against a bound of their prior
  std::vector<ParameterDrift> parameter_drift;  ///< filled by whoever has the time: ParameterDrifts
  std::vector<ObservableDiscrepancy> discrepancies;  ///< filled by AddDiscrepancies()
  std::vector<PriorConflict> prior_conflicts{};      ///< filled by whoever shows it: PriorConflicts
  /// The stated noise against the curves themselves: campaign::NoiseWarnings. Whoever shows no
  /// posterior beside it adds PosteriorWarnings().
  std::vector<std::string> warnings{};
  std::string note;  ///< why something is not given; may be empty
};

/// Errors are those stated in the campaign, correlated where a correlation length or covariance is
/// given, and the scatter of packings that the posterior states, once for the measured specimen
/// (its share of it) and, where no posterior could be given, once for the model's run. Without an
/// independent scale of the errors (noise inferred or ess_target) nothing can be said about
/// adequacy: z, p_value and reduced_chi2 stay empty.
Comparison Compare(const CampaignView& view, const std::vector<ExperimentPrediction>& predictions);

/// Standard deviation of one reading as compared: the stated one, or what ess_target's sigma makes
/// of the reading.
double ErrorOf(const CampaignView& view, const campaign::MeasuredObservable& observable,
               std::size_t reading);

}  // namespace calib::report
