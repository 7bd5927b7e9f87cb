#pragma once
// Residuals of one observable of one experiment with what is known of their errors.

#include <Eigen/Core>
#include <string>
#include <vector>

#include "server/report/views/campaign_view.h"
#include "server/report/views/predictions.h"

namespace calib::report {

/// At the readings that the prediction covers, in the order of loading; may be none.
struct ResidualGroup {
  const campaign::Experiment* experiment = nullptr;
  const campaign::MeasuredObservable* observable = nullptr;
  std::vector<std::size_t> readings;  ///< their indices in the experiment
  Eigen::VectorXd residual;           ///< model - measurement
  Eigen::MatrixXd covariance;         ///< errors by noise and packing scatter together
  double scatter = 0;                 ///< rms of its sd over that of the noise
  std::string scatter_from{};
  /// Covariance of the mean of the model's runs, for data that were not fitted: how far its
  /// parameters may be off, and that the runs are finitely many. Zero where it is not known.
  Eigen::MatrixXd of_prediction;
  /// Covariance of a single run by packings or twins, and how many it is known from; 0 x 0 and 0
  /// where neither were run.
  Eigen::MatrixXd of_scatter{};
  int scatter_runs = 0;
  bool twins = false;  ///< these runs: each sample then has a scatter of its own
  Eigen::VectorXd model;
};

/// The group of the readings of the experiment's observable j.
ResidualGroup MakeResidualGroup(const CampaignView& view, const campaign::Experiment& experiment,
                                std::size_t j, const ObservablePrediction& prediction);

}  // namespace calib::report
