#pragma once
// The measurements as the inference sees them: a flat vector of T readings with Gaussian errors.
// Plain values; functions of them are pure and thread safe.

#include <Eigen/Core>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "inference/data/model_error.h"

namespace calib::inference {

/// One measured number. Readings are held in processing order: by experiment, load step,
/// observable.
struct Reading {
  int experiment = 0;  ///< index, >= 0
  int observable = 0;  ///< index within the experiment, >= 0
  int load_step = 0;   ///< index within the experiment, >= 0
  /// Path length of the control since the start of loading, in the control's unit: what the
  /// distance between correlated errors is measured in.
  double control = 0;
  double value = 0;
  /// Standard deviation of the error, in the unit of `value`, > 0; not used with kEssTarget.
  double sd = 0;
};

/// Correlation of the errors of one observable of one experiment: exp(-|c_i - c_j| / length) for
/// readings at the controls c_i and c_j.
struct Correlation {
  int experiment = 0;
  int observable = 0;
  double length = 0;  ///< > 0, in the control's unit
};

/// Covariance of the errors of one observable of one experiment, given in full in the place of a
/// correlation length.
struct GroupCovariance {
  int experiment = 0;
  int observable = 0;
  /// n x n for the n readings of the observable in processing order, in the square of their unit;
  /// the square of each reading's sd is its diagonal.
  Eigen::MatrixXd matrix;
};

/// Inverse gamma prior of the factor f by which inferred noise multiplies the stated variances:
///   p(f) = rate^shape / Gamma(shape) f^(-shape-1) exp(-rate / f).
/// The default weighs as much as one reading that lies one stated sd off: the stated sd is trusted
/// within a factor of a few (f in [0.26, 254] with 90 %), and a handful of readings overrules it.
struct VarianceFactorPrior {
  double shape = 0.5;  ///< > 0
  double rate = 0.5;   ///< > 0
};

/// Readings whose errors share one variance factor: those of each (experiment, observable) named.
///                                                                     [Hadjidoukas 2014, sec. 2.3]
struct NoiseGroup {
  std::vector<std::pair<int, int>> members;  ///< (experiment, observable), at least one
  VarianceFactorPrior prior = {};
};

/// How large the errors of the readings are taken to be.
enum class NoiseMode {
  /// Their stated standard deviations.
  kGiven,
  /// The stated standard deviations times sqrt(f), one variance factor f per noise group,
  /// integrated
  /// out over its prior (gaussian_likelihood.h).
  kInferred,
  /// Variances sigma w_j y^2 of a reading y of observable j, independent, with the sigma that
  /// leaves
  /// a wanted share of the samples effective: a tempering, not an estimate.
  ///                                                                         [Cheng 2019, sec. 3.4]
  kEssTarget,
  /// The stated standard deviations and an inferred error of the model beside them, integrated out
  /// over its prior (model_error.h); readings that stand in none have their stated ones.
  kModelError,
};

/// The readings of all experiments with what is stated of their errors.
struct DataSet {
  std::vector<Reading> readings;             ///< T, in processing order
  std::vector<Correlation> correlations;     ///< observables without one: independent errors
  std::vector<GroupCovariance> covariances;  ///< each in the place of sd and correlation
  /// For NoiseMode::kInferred: who shares a factor; an (experiment, observable) that stands in no
  /// group has a factor of its own.
  std::vector<NoiseGroup> noise_groups = {};
  /// For NoiseMode::kModelError; no (experiment, observable) stands in two.
  std::vector<ModelError> model_errors = {};
  /// For NoiseMode::kEssTarget: w_j, indexed [experiment][observable]; it multiplies the variance.
  /// Empty: all one.
  std::vector<std::vector<double>> ess_weights;
};

/// Whether the data can be used with this noise. Errors: INVALID_ARGUMENT with one sentence: no
/// readings, negative index, value or control that is not finite, sd that is not positive (value
/// zero with kEssTarget), correlation length that is not positive or given twice, correlated
/// readings at one and the same control, a covariance that is not symmetric, does not fit its
/// readings or stands beside another one or a correlation length, a noise group without members or
/// with one that stands in another, a factor's prior whose shape or rate is not positive, a model
/// error without members, without a part, with a member that stands in another or a prior that
/// begins below zero,
/// ess_weights that are not positive or missing for an observable.
absl::Status ValidateData(const DataSet& data, NoiseMode noise);

/// Indices of the readings of each (experiment, observable), in processing order.
using ReadingGroups = std::map<std::pair<int, int>, std::vector<int>>;

/// The readings of `data` by (experiment, observable).
ReadingGroups GroupsOf(const DataSet& data);

/// All groups of readings that share a variance factor: those of data.noise_groups and one for
/// every other (experiment, observable). Members without readings are left out; members, and groups
/// by their first member, are in ascending order of (experiment, observable).
std::vector<NoiseGroup> NoiseGroupsOf(const DataSet& data);

/// True where the errors of a group, an (experiment, observable), have a correlation length or a
/// covariance.
bool IsCorrelated(const DataSet& data, std::pair<int, int> group);

/// Covariance matrix of the errors of all readings, T x T, in the square of their units.
Eigen::MatrixXd ErrorCovariance(const DataSet& data);

/// Correlation matrix of the errors of the n readings of a group, an (experiment, observable), n x
/// n: the identity, exp(-|c_i - c_j| / length) or that of its covariance. readings: the group's, as
/// GroupsOf gives them.
Eigen::MatrixXd ErrorCorrelation(const DataSet& data, std::pair<int, int> group,
                                 const std::vector<int>& readings);

/// The data with some of the readings alone, ascending indices, and the errors that go with them.
DataSet Restricted(const DataSet& data, const std::vector<int>& readings);

/// The data with the readings in reversed processing order.
DataSet Reversed(const DataSet& data);

/// The data with every error `factor` > 0 times as large and correlated as before.
DataSet WithLargerErrors(const DataSet& data, double factor);

/// The data with independent errors of variance sigma w_j y^2 in the place of the stated ones,
/// those of NoiseMode::kEssTarget, so that a likelihood by kGiven serves that mode too. sigma > 0.
/// Needs data that ValidateData accepts with kEssTarget.
DataSet WithRelativeErrors(const DataSet& data, double sigma);

}  // namespace calib::inference
