#include "server/diagnosis/history_scale.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <string>

namespace calib::diagnosis {
namespace {

using Eigen::Index;

// A floor of the error below this part of its relative share leaves the logarithm's sd constant to
// half a per cent.
constexpr double kSmallFloor = 0.1;
// Below this part of a reading the logarithm goes on as a straight line: a run there is wrong by
// more than any error, and its logarithm has no bound.
constexpr double kLineBelow = 0.05;

// Whether the error of a group of readings is relative: on their logarithm it is constant.
bool IsRelative(const campaign::MeasuredObservable& observable, const inference::DataSet& data,
                const std::vector<int>& readings) {
  if (!observable.noise || observable.noise->absolute || !(observable.noise->relative > 0))
    return false;
  double least = std::numeric_limits<double>::infinity();
  for (const int k : readings)
    least = std::min(least, data.readings[static_cast<std::size_t>(k)].value);
  return least > 0 && observable.noise->floor <= kSmallFloor * observable.noise->relative * least;
}

inference::PathCurve CurveOf(const campaign::Experiment& experiment, const inference::DataSet& data,
                             const std::vector<int>& readings) {
  inference::PathCurve curve{.path = Eigen::VectorXd(static_cast<Index>(readings.size()))};
  std::map<std::string, int> stages;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const inference::Reading& reading = data.readings[static_cast<std::size_t>(readings[i])];
    const auto step = static_cast<std::size_t>(reading.load_step);
    const std::string name = step < experiment.segment.size() ? experiment.segment[step] : "";
    curve.stage.push_back(stages.emplace(name, static_cast<int>(stages.size())).first->second);
    curve.path[static_cast<Index>(i)] = reading.control;
  }
  return curve;
}

}  // namespace

HistoryScale::HistoryScale(const campaign::Campaign& campaign, const inference::DataSet& data) {
  const auto t = static_cast<Index>(data.readings.size());
  value_.resize(t);
  sd_.resize(t);
  for (const auto& [group, readings] : inference::GroupsOf(data)) {
    const campaign::Experiment& experiment =
        campaign.experiments[static_cast<std::size_t>(group.first)];
    const bool relative =
        IsRelative(experiment.observables[static_cast<std::size_t>(group.second)], data, readings);
    curves_.push_back(CurveOf(experiment, data, readings));
    names_.emplace_back(experiment.name,
                        experiment.observables[static_cast<std::size_t>(group.second)].name);
    for (const int k : readings) {
      const auto column = static_cast<Index>(order_.size());
      const inference::Reading& reading = data.readings[static_cast<std::size_t>(k)];
      value_[column] = reading.value;
      sd_[column] = reading.sd;
      order_.push_back(k);
      logarithmic_.push_back(relative);
    }
  }
}

Eigen::MatrixXd HistoryScale::Scaled(const Eigen::MatrixXd& of) const {
  Eigen::MatrixXd result(of.rows(), of.cols());
  for (Index c = 0; c < result.cols(); ++c) {
    const auto y = of.col(order_[static_cast<std::size_t>(c)]);
    if (!is_logarithmic(c)) {
      result.col(c) = (y.array() - value_[c]) / sd_[c];
      continue;
    }
    for (Index i = 0; i < result.rows(); ++i) {
      const double ratio = y[i] / value_[c];
      const double log =
          ratio > kLineBelow ? std::log(ratio) : std::log(kLineBelow) + ratio / kLineBelow - 1;
      result(i, c) = log * value_[c] / sd_[c];
    }
  }
  return result;
}

Eigen::MatrixXd HistoryScale::Readings(const Eigen::MatrixXd& scaled) const {
  Eigen::MatrixXd result(scaled.rows(), scaled.cols());
  const double least = std::log(kLineBelow);
  for (Index c = 0; c < scaled.cols(); ++c) {
    auto y = result.col(order_[static_cast<std::size_t>(c)]);
    if (!is_logarithmic(c)) {
      y = scaled.col(c).array() * sd_[c] + value_[c];
      continue;
    }
    for (Index i = 0; i < scaled.rows(); ++i) {
      const double log = scaled(i, c) * sd_[c] / value_[c];
      y[i] = value_[c] * (log > least ? std::exp(log) : kLineBelow * (log - least + 1));
    }
  }
  return result;
}

Eigen::MatrixXd HistoryScale::Departures(const Eigen::MatrixXd& of) const {
  return of(Eigen::all, order_) * sd_.cwiseInverse().asDiagonal();
}

}  // namespace calib::diagnosis
