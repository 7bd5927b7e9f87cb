#include "server/diagnosis/stage_shapes.h"

#include <cstddef>
#include <map>
#include <string>
#include <tuple>

namespace calib::diagnosis {
namespace {

using Eigen::Index;

constexpr std::size_t kFewestForATrend = 4;

}  // namespace

std::vector<Eigen::MatrixXd> StageShapes(const campaign::Campaign& campaign,
                                         const inference::DataSet& data) {
  const auto t = static_cast<Index>(data.readings.size());
  // Readings by experiment, observable and stage, in the order of the path.
  std::map<std::tuple<int, int, std::string>, std::vector<Index>> stages;
  for (Index k = 0; k < t; ++k) {
    const inference::Reading& reading = data.readings[static_cast<std::size_t>(k)];
    const auto& segment =
        campaign.experiments[static_cast<std::size_t>(reading.experiment)].segment;
    const auto step = static_cast<std::size_t>(reading.load_step);
    stages[{reading.experiment, reading.observable, step < segment.size() ? segment[step] : ""}]
        .push_back(k);
  }
  std::vector<Eigen::MatrixXd> sets;
  for (const bool trends : {false, true}) {
    std::vector<Eigen::VectorXd> shapes;
    for (const auto& [stage, readings] : stages) {
      Eigen::VectorXd constant = Eigen::VectorXd::Zero(t);
      constant(readings).setOnes();
      shapes.push_back(constant);
      if (!trends || readings.size() < kFewestForATrend) continue;
      Eigen::VectorXd trend = Eigen::VectorXd::Zero(t);
      trend(readings).setLinSpaced(-1, 1);
      shapes.push_back(trend);
    }
    if (2 * static_cast<Index>(shapes.size()) > t) break;
    Eigen::MatrixXd& set = sets.emplace_back(t, static_cast<Index>(shapes.size()));
    for (Index q = 0; q < set.cols(); ++q) set.col(q) = shapes[static_cast<std::size_t>(q)];
  }
  return sets;
}

}  // namespace calib::diagnosis
