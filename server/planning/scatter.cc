#include "server/planning/scatter.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "calib/return_if_error.h"
#include "server/campaign/model/replicates.h"
#include "server/campaign/model/scatter_fit.h"
#include "server/planning/history.h"

namespace calib::planning {
namespace {

using campaign::Role;
using Eigen::Index;

// Replicates x readings of one role, NaN where a run did not come.
absl::StatusOr<Eigen::MatrixXd> ReplicateRuns(const campaign::Campaign& campaign,
                                              const inference::DataSet& data, std::int64_t id,
                                              const std::vector<int>& samples,
                                              store::Reader& reader) {
  const ReadingIndex index(campaign, data);
  Eigen::MatrixXd runs = Eigen::MatrixXd::Constant(static_cast<Index>(samples.size()),
                                                   static_cast<Index>(data.readings.size()),
                                                   std::numeric_limits<double>::quiet_NaN());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    ASSIGN_OR_RETURN(const auto states, reader.States(id, samples[i]));
    Eigen::RowVectorXd row = runs.row(static_cast<Index>(i));
    for (const store::StateRecord& state : states) {
      index.Place(state.key.experiment, state.load_step, state.observables, row);
    }
    runs.row(static_cast<Index>(i)) = row;
  }
  return runs;
}

}  // namespace

double LargestScatterShare(const campaign::Campaign& campaign) {
  double largest = 0;
  for (const campaign::Experiment& experiment : campaign.experiments) {
    if (experiment.role == Role::kCalibrate) {
      largest = std::max(largest, campaign::ScatterShare(experiment));
    }
  }
  return largest;
}

absl::StatusOr<MeasuredScatter> MeasureScatter(const Definition& definition, std::int64_t campaign,
                                               store::Reader& reader) {
  ASSIGN_OR_RETURN(const auto iterations, reader.Iterations(campaign));
  ASSIGN_OR_RETURN(const auto all, reader.Samples(campaign));
  std::vector<int> samples;
  for (const store::IterationRecord& iteration : iterations) {
    for (const store::SampleRecord& sample : all) {
      if (iteration.proposal == kReplicates && sample.iteration == iteration.number) {
        samples.push_back(sample.sample);
      }
    }
  }
  MeasuredScatter result;
  for (const Role role : {Role::kCalibrate, Role::kValidate}) {
    const inference::DataSet data = campaign::MakeDataSet(definition.campaign, role);
    ASSIGN_OR_RETURN(const auto runs,
                     ReplicateRuns(definition.campaign, data, campaign, samples, reader));
    if (role == Role::kCalibrate) {
      const auto packings = static_cast<Index>(campaign::PackingsOfAll(definition.campaign));
      result.departures =
          inference::ScaledDepartures(runs.topRows(std::min(packings, runs.rows())),
                                      campaign::ScatterShares(definition.campaign, data));
    }
    for (const auto& group : inference::GroupsOf(data)) {
      // Beyond its own packings an experiment's replicates are repetitions.
      const auto& specimens =
          definition.campaign.experiments[static_cast<std::size_t>(group.first.first)].specimens;
      const bool varies = campaign::VariesPackings(definition.campaign);
      const Index packings =
          varies ? std::min(runs.rows(), static_cast<Index>(specimens.size())) : runs.rows();
      Eigen::MatrixXd finished(packings, static_cast<Index>(group.second.size()));
      Eigen::VectorXd number(packings);
      Index count = 0;
      for (Index r = 0; r < packings; ++r) {
        for (Index i = 0; i < finished.cols(); ++i) {
          finished(count, i) = runs(r, group.second[static_cast<std::size_t>(i)]);
        }
        number[count] = static_cast<double>(r);
        count += finished.row(count).allFinite() ? 1 : 0;
      }
      if (count < 2) {
        continue;
      }
      Eigen::VectorXd noise(finished.cols());
      for (Index i = 0; i < noise.size(); ++i) {
        const int reading = group.second[static_cast<std::size_t>(i)];
        noise[i] = data.readings[static_cast<std::size_t>(reading)].sd;
      }
      if (!varies && !inference::HaveParted(finished.topRows(count), number.head(count), noise)) {
        continue;
      }
      result.observables.push_back({.group = campaign::FitGroupScatter(
                                        definition.campaign, data, group,
                                        inference::MomentsOfReplicates(finished.topRows(count))),
                                    .from = varies ? "realizations" : "repeats",
                                    .runs = static_cast<int>(count)});
    }
  }
  return result;
}

std::vector<ObservableScatter> ScatterOfEmulator(const Definition& definition,
                                                 const inference::EmulatedResult& emulated) {
  std::vector<ObservableScatter> result;
  const Eigen::MatrixXd& factor = emulated.scatter_factor;
  for (const auto& group : inference::GroupsOf(definition.data)) {
    const auto n = static_cast<Index>(group.second.size());
    inference::ScatterMoments moments{.variance = Eigen::VectorXd(n),
                                      .neighbour = Eigen::VectorXd(std::max<Index>(0, n - 1))};
    for (Index i = 0; i < n; ++i) {
      const int t = group.second[static_cast<std::size_t>(i)];
      moments.variance[i] = factor.row(t).squaredNorm() + emulated.scatter_white[t];
      if (i + 1 < n) {
        moments.neighbour[i] =
            factor.row(t).dot(factor.row(group.second[static_cast<std::size_t>(i) + 1]));
      }
    }
    result.push_back(
        {.group = campaign::FitGroupScatter(definition.campaign, definition.data, group, moments),
         .from = "emulator",
         .runs = emulated.runs});
  }
  return result;
}

Definition DefinitionWith(const Definition& definition, const MeasuredScatter& scatter) {
  Definition with = definition;
  if (!definition.campaign.method->weighs_samples() ||
      definition.campaign.filter.noise != inference::NoiseMode::kGiven) {
    return with;
  }
  const bool varies = campaign::VariesPackings(definition.campaign);
  std::vector<inference::GroupScatter> groups;
  std::vector<inference::GroupScatter> of_mean;
  int fewest = std::numeric_limits<int>::max();
  for (const ObservableScatter& one : scatter.observables) {
    const auto& experiment =
        definition.campaign.experiments[static_cast<std::size_t>(one.group.experiment)];
    if (experiment.role == Role::kCalibrate) {
      groups.push_back(one.group);
      fewest = std::min(fewest, one.runs);
      // The mean over R packings is off by 1/R of the scatter, however many samples share them;
      // every sample on the only packing is a twin of its own.
      of_mean.push_back(one.group);
      if (varies) of_mean.back().share += 1.0 / one.runs;
    }
  }
  if (!groups.empty()) {
    with.data = inference::WithScatter(definition.data, groups, 1);
    const Eigen::MatrixXd covariance = inference::ErrorCovariance(with.data);
    with.of_scatter = covariance - inference::ErrorCovariance(definition.data);
    with.known = inference::WhatIsKnown(covariance, with.of_scatter, fewest);
    with.mean_data = inference::WithScatter(definition.data, of_mean, 0);
    if (scatter.departures.rows() > 0) {
      with.replicates = {.departures = scatter.departures,
                         .scatter = inference::ErrorCovariance(*with.mean_data) -
                                    inference::ErrorCovariance(definition.data)};
    }
  }
  return with;
}

}  // namespace calib::planning
