// What of the likelihood integrates over model errors.

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "calib/return_if_error.h"
#include "inference/data/gaussian_likelihood.h"
#include "inference/numerics/infinity.h"

namespace calib::inference {

absl::Status GaussianLikelihood::AddLevels(const DataSet& data) {
  const ReadingGroups all = GroupsOf(data);
  for (std::size_t e = 0; e < data.model_errors.size(); ++e) {
    const ModelError& error = data.model_errors[e];
    LevelGroup group;
    group.error = e;
    for (const auto& member : error.members) {
      const auto found = all.find(member);
      if (found == all.end()) continue;
      group.readings.insert(group.readings.end(), found->second.begin(), found->second.end());
    }
    if (group.readings.empty()) continue;
    std::sort(group.readings.begin(), group.readings.end());
    group.cells = CellsOf(error, data);
    group.log_mass = group.cells.LogMass();
    DataSet unit = Restricted(data, group.readings);
    group.sd.resize(static_cast<Eigen::Index>(unit.readings.size()), group.log_mass.size());
    for (Eigen::Index t = 0; t < group.sd.rows(); ++t) {
      Reading& reading = unit.readings[static_cast<std::size_t>(t)];
      for (Eigen::Index k = 0; k < group.sd.cols(); ++k) {
        group.sd(t, k) = RaisedError(group.cells, k, reading.value, reading.sd);
      }
      reading.value = 0;
      reading.sd = 1;
    }
    for (GroupCovariance& covariance : unit.covariances) {
      const Eigen::VectorXd inverse = covariance.matrix.diagonal().cwiseSqrt().cwiseInverse();
      covariance.matrix = inverse.asDiagonal() * covariance.matrix * inverse.asDiagonal();
    }
    unit.noise_groups.clear();
    unit.model_errors.clear();
    ASSIGN_OR_RETURN(auto made, Create(unit, NoiseMode::kGiven));
    group.unit.push_back(std::move(made));
    levels_.push_back(std::move(group));
  }
  return absl::OkStatus();
}

Eigen::MatrixXd GaussianLikelihood::AtLevel(const LevelGroup& group, Eigen::Index level,
                                            const Rows& predictions, Missing missing) const {
  Eigen::MatrixXd scaled(predictions.rows(), group.sd.rows());
  for (Eigen::Index t = 0; t < scaled.cols(); ++t) {
    const int reading = group.readings[static_cast<std::size_t>(t)];
    scaled.col(t) =
        (predictions.col(reading).array() - values_[static_cast<std::size_t>(reading)]) /
        group.sd(t, level);
  }
  Eigen::MatrixXd increments = group.unit.front().Fill(scaled, missing);
  for (Eigen::Index t = 0; t < scaled.cols(); ++t) {
    increments.col(t).array() -= std::log(group.sd(t, level));
  }
  return increments;
}

// The increment of a reading is the ratio of the mixture's densities with and without it,
//   M_t = sum_k mass_k prod_{s <= t} p_k(y_s | earlier).
void GaussianLikelihood::IntegrateLevels(const LevelGroup& group, const Rows& predictions,
                                         Missing missing, MutableRows increments) const {
  const Eigen::Index n = predictions.rows();
  const Eigen::Index size = group.sd.rows();
  Eigen::ArrayXXd largest = Eigen::ArrayXXd::Constant(n, size, -kInfinity);
  Eigen::ArrayXXd sum = Eigen::ArrayXXd::Zero(n, size);  // over levels, relative to the largest
  for (Eigen::Index k = 0; k < group.log_mass.size(); ++k) {
    const Eigen::MatrixXd at_level = AtLevel(group, k, predictions, missing);
    Eigen::ArrayXd so_far = Eigen::ArrayXd::Constant(n, group.log_mass[k]);
    for (Eigen::Index t = 0; t < size; ++t) {
      for (Eigen::Index i = 0; i < n; ++i) {
        if (std::isnan(at_level(i, t))) {
          sum(i, t) = std::numeric_limits<double>::quiet_NaN();
          continue;
        }
        so_far[i] += at_level(i, t);
        if (so_far[i] == -kInfinity) continue;
        double& most = largest(i, t);
        if (so_far[i] > most) {
          sum(i, t) = sum(i, t) * std::exp(most - so_far[i]) + 1;
          most = so_far[i];
        } else {
          sum(i, t) += std::exp(so_far[i] - most);
        }
      }
    }
  }
  Eigen::ArrayXd before = Eigen::ArrayXd::Zero(n);
  for (Eigen::Index t = 0; t < size; ++t) {
    auto column = increments.col(group.readings[static_cast<std::size_t>(t)]);
    for (Eigen::Index i = 0; i < n; ++i) {
      const double now = largest(i, t) + std::log(sum(i, t));
      column[i] = now == -kInfinity ? now : now - before[i];
      if (now > -kInfinity) before[i] = now;
    }
  }
}

std::vector<GaussianLikelihood::ErrorLevels> GaussianLikelihood::ModelErrors(
    const Eigen::MatrixXd& predictions) const {
  std::vector<ErrorLevels> all;
  for (const LevelGroup& group : levels_) {
    ErrorLevels of_group{.error = group.error,
                         .cells = group.cells,
                         .log_joint = {predictions.rows(), group.log_mass.size()}};
    for (Eigen::Index k = 0; k < group.log_mass.size(); ++k) {
      const Eigen::MatrixXd at_level = AtLevel(group, k, predictions, Missing::kStop);
      auto column = of_group.log_joint.col(k);
      column.setConstant(group.log_mass[k]);
      for (Eigen::Index t = 0; t < at_level.cols(); ++t) {
        column += at_level.col(t).unaryExpr([](double x) { return std::isnan(x) ? 0.0 : x; });
      }
    }
    all.push_back(std::move(of_group));
  }
  return all;
}

}  // namespace calib::inference
