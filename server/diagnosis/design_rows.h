#pragma once
// Rows of a design: points in the coordinates of an emulator as values of parameters by name, and
// back. An effect of strength zero stands at its null to the bit, so that it is not in the run.

#include <Eigen/Core>
#include <string>
#include <vector>

#include "inference/diagnosis/design_runs.h"
#include "inference/prior/prior.h"
#include "server/campaign/model/campaign.h"
#include "server/diagnosis/race_list.h"

namespace calib::diagnosis {

/// Scaled base parameters: x = (s - middle) / half, s the standard coordinate of the prior
/// (Prior::ToStandard). A value; const functions are pure.
struct BaseAxes {
  std::vector<inference::Prior> priors{};  ///< d
  Eigen::VectorXd middle{}, half{};        ///< d, half > 0

  Eigen::MatrixXd Scaled(const Eigen::MatrixXd& values) const;  ///< n x d of n x d, SI
  Eigen::MatrixXd Values(const Eigen::MatrixXd& scaled) const;  ///< n x d, SI, of n x d
  /// The axes on which [low, high] of these is [-1, 1].
  BaseAxes Narrowed(const Eigen::VectorXd& low, const Eigen::VectorXd& high) const;
};

/// The axes on which these values (n x d, SI, n >= 2, within the priors) range from -1 to 1. Where
/// all of them are equal in one parameter, half is one standard deviation of its prior.
BaseAxes AxesOver(std::vector<inference::Prior> priors, const Eigen::MatrixXd& values);

/// Rows of the design of a race. Immutable; thread safety: const.
class DesignRows {
 public:
  /// unit: K, SI, > 0: distance from the null of strength 1 (DesignPoints).
  DesignRows(BaseAxes axes, Race race, Eigen::VectorXd unit);

  const BaseAxes& axes() const { return axes_; }
  const Race& race() const { return race_; }
  const Eigen::VectorXd& unit() const { return unit_; }
  /// The same rows in other units.
  DesignRows With(BaseAxes axes, Eigen::VectorXd unit) const {
    return {std::move(axes), race_, std::move(unit)};
  }

  /// The same rows, whose entries go no farther than these distances (K, SI) from their nulls.
  DesignRows EndingAt(const Eigen::VectorXd& most, const Eigen::VectorXd& most_other) const;

  /// Of the parameters: those of the base, strength and shapes of each entry, numerics.
  const std::vector<std::string>& names() const { return names_; }
  Eigen::Index shape_count() const { return shape_count_; }  ///< H
  /// First column of DesignPoints::shape that belongs to the entry.
  Eigen::Index first_shape(int entry) const {
    return first_shape_[static_cast<std::size_t>(entry)];
  }
  /// K: largest strength of each entry to its positive side and to the other.
  Eigen::VectorXd Most() const;
  Eigen::VectorXd MostOther() const;

  /// The values of row `row` of the points, numerics at their null; strengths are cut to what the
  /// entry can have.
  std::vector<double> Values(const inference::DesignPoints& points, Eigen::Index row) const;
  /// The values of a run at the middle of the base's axes without an effect.
  std::vector<double> WithoutEffects() const;
  /// The points of rows of values. A strength at its null is zero; shapes of an effect that is off
  /// are zero.
  inference::DesignPoints Points(const std::vector<std::vector<double>>& rows) const;
  /// Number of the numerical choice that the values change; -1: none.
  int ChangedNumerics(const std::vector<double>& values) const;
  /// These values with all numerical choices at their null.
  std::vector<double> WithoutNumerics(std::vector<double> values) const;
  /// These values with a numerical choice as it is tried.
  std::vector<double> WithNumerics(std::vector<double> values, int choice) const;

 private:
  double SignOf(int entry) const;

  BaseAxes axes_;
  Race race_;
  Eigen::VectorXd unit_;
  std::vector<std::string> names_;
  std::vector<Eigen::Index> first_shape_;
  Eigen::Index shape_count_ = 0;
};

}  // namespace calib::diagnosis
