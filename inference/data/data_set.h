#pragma once
// The measurements as the inference sees them: a flat vector of readings with Gaussian errors.

#include <Eigen/Core>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"

namespace calib::inference {

/// One measured number. Readings are held in processing order: experiment, load step, observable.
struct Reading {
  int experiment = 0;
  int observable = 0;  ///< index within the experiment
  int load_step = 0;
  /// Path length of the control since the start of loading: distance for the correlation.
  double control = 0;
  double value = 0;
  double sd = 0;  ///< standard deviation of its error (noise: given) > 0; unused with ess_target
};

/// Errors of one observable of one experiment are correlated as exp(-|c_i - c_j| / length); 0:
/// independent.
struct Correlation {
  int experiment = 0;
  int observable = 0;
  double length = 0;
};

/// Covariance of the errors of one observable of one experiment, in the place of their correlation
/// length: n x n for its n readings in processing order, in the square of their unit; the sd of
/// each reading is the root of its diagonal.
struct GroupCovariance {
  int experiment = 0;
  int observable = 0;
  Eigen::MatrixXd matrix;
};

/// Prior of the variance factor f of noise: inferred, inverse gamma:
///   p(f) = rate^shape / Gamma(shape) f^(-shape-1) exp(-rate / f),  shape > 0, rate > 0.
/// The default weighs as much as one reading that lies one stated sd off: the stated sd is trusted
/// within a factor of a few (f in [0.26, 254] with 90 %), and a handful of readings overrules it.
struct VarianceFactorPrior {
  double shape = 0.5;
  double rate = 0.5;
};

/// Readings whose errors share one variance factor [Hadjidoukas 2014, sec. 2.3]: those of each
/// (experiment, observable) named.
struct NoiseGroup {
  std::vector<std::pair<int, int>> members;  ///< (experiment, observable), at least one
  VarianceFactorPrior prior = {};
};

enum class NoiseMode {
  kGiven,  ///< the sd of each reading
  /// sd of each reading times sqrt(f), one variance factor f per noise group, marginalised over its
  /// prior (gaussian_likelihood.h).
  kInferred,
  /// Sigma = sigma w_j y^2, sigma from the effective sample size [Cheng 2019, sec. 3.4]; a
  /// tempering, not an estimate.
  kEssTarget,
};

struct DataSet {
  std::vector<Reading> readings;
  std::vector<Correlation> correlations;     ///< only those with length > 0
  std::vector<GroupCovariance> covariances;  ///< of groups that have one
  /// Of kInferred; an (experiment, observable) that stands in none has a factor of its own.
  std::vector<NoiseGroup> noise_groups = {};
  /// w_j of kEssTarget, indexed [experiment][observable]; multiplies the variance. Empty: all one.
  std::vector<std::vector<double>> ess_weights;
};

/// INVALID_ARGUMENT with one sentence: no readings, negative index, value or control that is not
/// finite, sd that is not positive (value zero with kEssTarget), correlation length that is not
/// positive or given twice, correlated readings at one and the same control, a covariance that is
/// not symmetric, does not fit its readings or stands beside another one or a correlation length,
/// a noise group without members or with one that stands in another, a factor's prior whose shape
/// or rate is not positive, ess_weights that are not positive or missing for an observable.
absl::Status ValidateData(const DataSet& data, NoiseMode noise);

/// Indices of the readings of each (experiment, observable), in processing order.
using ReadingGroups = std::map<std::pair<int, int>, std::vector<int>>;
ReadingGroups GroupsOf(const DataSet& data);

/// All groups of readings that share a variance factor: those of data.noise_groups and one for
/// every other (experiment, observable); members without readings left out, members and groups in
/// ascending order of (experiment, observable), the group by its first member.
std::vector<NoiseGroup> NoiseGroupsOf(const DataSet& data);

/// True where the errors of a group are correlated.
bool IsCorrelated(const DataSet& data, std::pair<int, int> group);

/// Covariance matrix of the errors of all readings, T x T, in the square of their units.
Eigen::MatrixXd ErrorCovariance(const DataSet& data);

/// Correlation matrix of the errors of a group's readings: the identity, exp(-distance / length) or
/// that of its covariance.
Eigen::MatrixXd ErrorCorrelation(const DataSet& data, std::pair<int, int> group,
                                 const std::vector<int>& readings);

/// Some of the readings, ascending indices, with the errors that go with them.
DataSet Restricted(const DataSet& data, const std::vector<int>& readings);

/// The same readings in reversed processing order.
DataSet Reversed(const DataSet& data);

/// The same readings with every error `factor` times as large and correlated as before. factor > 0.
DataSet WithLargerErrors(const DataSet& data, double factor);

/// The same readings with independent errors of variance sigma w_j y^2, the Sigma of kEssTarget, so
/// that the likelihood of kGiven serves both. sigma > 0; multiplies the variance. Needs
/// ValidateData(data, kEssTarget).
DataSet WithRelativeErrors(const DataSet& data, double sigma);

}  // namespace calib::inference
