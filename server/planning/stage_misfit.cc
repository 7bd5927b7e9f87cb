#include "server/planning/stage_misfit.h"

#include <cmath>
#include <limits>
#include <string>

#include "inference/data/data_set.h"
#include "inference/data/gaussian_likelihood.h"
#include "inference/filter/posterior_checks.h"
#include "inference/scatter/chi_squared_law.h"

namespace calib::planning {
namespace {

using Eigen::Index;

Stage MakeStage(const Definition& definition, std::pair<int, int> group,
                std::vector<int> readings) {
  Stage stage{.experiment = group.first, .observable = group.second};
  stage.first = definition.data.readings[static_cast<std::size_t>(readings.front())].load_step;
  stage.last = definition.data.readings[static_cast<std::size_t>(readings.back())].load_step;
  if (definition.of_scatter.size() > 0) {
    const std::vector<Index> at(readings.begin(), readings.end());
    const Eigen::MatrixXd covariance =
        inference::ErrorCovariance(inference::Restricted(definition.data, readings));
    stage.judged.known = inference::WhatIsKnown(covariance, definition.of_scatter(at, at),
                                                definition.known.packings);
  }
  stage.judged.readings = std::move(readings);
  return stage;
}

}  // namespace

std::vector<Stage> StagesOf(const Definition& definition) {
  std::vector<Stage> stages;
  if (definition.campaign.filter.noise != inference::NoiseMode::kGiven) return stages;
  for (const auto& [group, members] : inference::GroupsOf(definition.data)) {
    const std::vector<std::string>& segment =
        definition.campaign.experiments[static_cast<std::size_t>(group.first)].segment;
    const auto segment_of = [&](int reading) -> const std::string& {
      return segment[static_cast<std::size_t>(
          definition.data.readings[static_cast<std::size_t>(reading)].load_step)];
    };
    stages.push_back(MakeStage(definition, group, members));
    std::vector<int> of_stage;
    for (const int reading : members) {
      if (!of_stage.empty() && segment_of(of_stage.back()) != segment_of(reading)) {
        stages.push_back(MakeStage(definition, group, std::move(of_stage)));
        of_stage.clear();
      }
      of_stage.push_back(reading);
    }
    if (of_stage.size() < members.size()) {
      stages.push_back(MakeStage(definition, group, std::move(of_stage)));
    }
  }
  return stages;
}

std::vector<double> StageP(const Definition& definition, const std::vector<Stage>& stages,
                           const Eigen::MatrixXd& predictions, const Eigen::VectorXd& log_weights) {
  std::vector<double> p;
  for (const Stage& stage : stages) {
    const inference::DataSet data = inference::Restricted(definition.data, stage.judged.readings);
    const auto likelihood =
        inference::GaussianLikelihood::Create(data, inference::NoiseMode::kGiven);
    p.push_back(likelihood.ok() ? inference::PredictiveP(data,
                                                         likelihood->LogLikelihood(predictions(
                                                             Eigen::all, stage.judged.readings)),
                                                         log_weights, stage.judged.known)
                                : std::numeric_limits<double>::quiet_NaN());
  }
  return p;
}

}  // namespace calib::planning
