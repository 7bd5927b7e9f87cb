#pragma once
// The scale on which the diagnosis sees readings: errors are constant along a curve there and add.

#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

#include "inference/data/data_set.h"
#include "inference/diagnosis/stage_coordinates.h"
#include "server/campaign/model/campaign.h"

namespace calib::diagnosis {

/// Readings on a scale on which errors add: the logarithm where the stated error is relative (the
/// straight line that touches it where a run falls below a twentieth of the reading), the reading
/// itself elsewhere; in both, less what was measured and over its sd. The measured history is zero.
class HistoryScale {
 public:
  /// data: readings of the campaign's fitted experiments, sd > 0.
  HistoryScale(const campaign::Campaign& campaign, const inference::DataSet& data);
  /// n x T of n x T readings in SI; columns of `of` stand in the order of the data, those of the
  /// result one curve after the other.
  Eigen::MatrixXd Scaled(const Eigen::MatrixXd& of) const;
  /// n x T of n x T scaled ones: readings in SI, in the order of the data.
  Eigen::MatrixXd Readings(const Eigen::MatrixXd& scaled) const;
  /// What small departures from the measured history (R x T, SI, in the order of the data) are on
  /// this scale, R x T in the order of the result: to first order, which is one over the sd of the
  /// reading in either kind of column.
  Eigen::MatrixXd Departures(const Eigen::MatrixXd& of) const;
  /// The curves, in the order of the result.
  const std::vector<inference::PathCurve>& curves() const { return curves_; }
  /// Experiment and observable of each curve, by name.
  const std::vector<std::pair<std::string, std::string>>& names() const { return names_; }
  /// For each column of the result its place in the data.
  const std::vector<Eigen::Index>& order() const { return order_; }
  bool is_logarithmic(Eigen::Index column) const {
    return logarithmic_[static_cast<std::size_t>(column)];
  }

 private:
  std::vector<inference::PathCurve> curves_;
  std::vector<std::pair<std::string, std::string>> names_;
  std::vector<Eigen::Index> order_;
  std::vector<bool> logarithmic_;
  Eigen::VectorXd value_, sd_;  // in the order of the result
};

}  // namespace calib::diagnosis
