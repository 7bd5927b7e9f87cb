#pragma once
// The finished runs of a campaign as matrices, the way the inference and the diagnosis see them.

#include <Eigen/Core>
#include <vector>

#include "inference/data/data_set.h"
#include "server/report/views/campaign_view.h"

namespace calib::report {

/// Predictions of the readings of the calibrated experiments by the finished samples.
struct RunTable {
  std::vector<int> sample;     ///< numbers, ascending
  std::vector<int> stream;     ///< what decides on packing and seed of each (campaign::StreamOf)
  Eigen::MatrixXd parameters;  ///< N x d, SI
  Eigen::MatrixXd histories;   ///< N x T, (prediction - reading) / sd, in the order of MakeDataSet
};

/// Samples that did not get to the last reading of every calibrated experiment are left out.
RunTable RunsOf(const CampaignView& view);
/// RunsOf() with histories in the sd of `units`, which are the same readings in the same order with
/// errors of their own. Their numbers of experiments may differ, as they do where a derived
/// campaign leaves held-out ones out.
RunTable RunsOf(const CampaignView& view, const inference::DataSet& units);

/// The readings of the calibrated experiments with the scatter in their errors that the campaign
/// has measured on several packings, or by twins on one.
struct ScatteredReadings {
  inference::DataSet of_mean;  ///< scatter of the measured specimen, and 1/R of it for the model's
                               ///< mean history, which R packings know no better (twins do)
  inference::DataSet of_run;   ///< scatter of the specimen and of one run of the model
  /// Departures of the runs of the best estimate on every packing from their mean, for fits to some
  /// of the readings: R x T, see inference::Replicates; none where fewer than two runs came to
  /// their ends.
  Eigen::MatrixXd departures{};
  std::vector<int> departure_stream{};  ///< R, campaign::StreamOf of each
  /// R x T, units of the readings: what twins on the only packing depart by from their mean, zero
  /// of observables that they have not parted in; no rows where fewer than two came to their ends.
  Eigen::MatrixXd twins{};
  /// False where packings were not varied and no twins have parted: both are MakeDataSet, and the
  /// scatter of single runs is what an emulator of them says it is.
  bool measured = false;
};
ScatteredReadings ReadingsWithScatter(const CampaignView& view);

}  // namespace calib::report
