#include "server/planning/definition.h"

#include <algorithm>
#include <cassert>
#include <string>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "dem/registry/catalog.h"
#include "server/planning/plan_memory.h"

namespace calib::planning {
namespace {

/// Position of an experiment's observable in its states: tables made elsewhere hold the measured
/// ones alone, and a program is asked for them alone.
std::size_t PositionInState(const campaign::Campaign& campaign,
                            const campaign::Experiment& experiment, int observable) {
  const auto index = static_cast<std::size_t>(observable);
  if (campaign.precomputed.has_value() || campaign.program.has_value()) {
    return index;
  }
  const auto& names = dem::FindTest(experiment.test)->observables;
  const auto found = std::find(names.begin(), names.end(), experiment.observables[index].name);
  assert(found != names.end());
  return static_cast<std::size_t>(found - names.begin());
}

}  // namespace

ReadingIndex::ReadingIndex(const campaign::Campaign& campaign, const inference::DataSet& data) {
  for (std::size_t t = 0; t < data.readings.size(); ++t) {
    const inference::Reading& reading = data.readings[t];
    const auto& experiment = campaign.experiments[static_cast<std::size_t>(reading.experiment)];
    columns_[{reading.experiment, reading.load_step}].push_back(
        {.reading = static_cast<Eigen::Index>(t),
         .observable = PositionInState(campaign, experiment, reading.observable)});
  }
}

void ReadingIndex::Place(
    int experiment, int load_step, std::span<const double> observables,
    Eigen::Ref<Eigen::RowVectorXd, 0, Eigen::InnerStride<>> predictions) const {
  const auto found = columns_.find({experiment, load_step});
  if (found == columns_.end()) {
    return;
  }
  for (const Column& column : found->second) {
    if (column.observable < observables.size()) {
      predictions(column.reading) = observables[column.observable];
    }
  }
}

std::vector<int> Definition::LoadSteps(int experiment) const {
  const auto& measured = campaign.experiments[static_cast<std::size_t>(experiment)];
  std::vector<int> steps;
  if (campaign.precomputed.has_value()) {
    for (std::size_t i = 0; i < measured.control.size(); ++i) {
      steps.push_back(static_cast<int>(i));
    }
    return steps;
  }
  for (const dem::ControlPoint& point : measured.path) {
    if (point.load_step >= 0) {
      steps.push_back(point.load_step);
    }
  }
  return steps;
}

std::size_t Definition::StateSize(int experiment) const {
  const auto& measured = campaign.experiments[static_cast<std::size_t>(experiment)];
  return campaign.precomputed.has_value() || campaign.program.has_value()
             ? measured.observables.size()
             : dem::FindTest(measured.test)->observables.size();
}

std::vector<int> Definition::ExperimentsOf(campaign::Role role) const {
  std::vector<int> indices;
  for (std::size_t i = 0; i < campaign.experiments.size(); ++i) {
    if (campaign.experiments[i].role == role) {
      indices.push_back(static_cast<int>(i));
    }
  }
  return indices;
}

campaign::FileReader StoredFiles(store::Reader& reader,
                                 const std::map<std::string, std::string>& files,
                                 absl::Status* unread) {
  return [&reader, files, unread](const std::string& path) -> absl::StatusOr<std::string> {
    const auto found = files.find(path);
    if (found == files.end()) {
      return absl::NotFoundError(absl::StrCat("file ", path, " was not submitted"));
    }
    auto content = reader.Blob(found->second);
    if (unread != nullptr && !content.ok() && !absl::IsNotFound(content.status())) {
      unread->Update(content.status());
    }
    return content;
  };
}

campaign::RunOf ToRun(const campaign::Campaign& campaign, const store::SampleRecord& sample) {
  return {.values = sample.parameters,
          .stream = sample.stream.value_or(campaign::StreamOf(campaign, sample.sample))};
}

std::shared_ptr<const Definition> MakeDefinition(campaign::Campaign campaign) {
  inference::DataSet data = campaign::MakeDataSet(campaign);
  inference::JointPrior priors = campaign::Priors(campaign);
  ReadingIndex readings(campaign, data);
  return std::make_shared<const Definition>(Definition{.campaign = std::move(campaign),
                                                       .data = std::move(data),
                                                       .mean_data = std::nullopt,
                                                       .replicates = std::nullopt,
                                                       .priors = std::move(priors),
                                                       .readings = std::move(readings),
                                                       .memory = std::make_shared<PlanMemory>()});
}

absl::StatusOr<std::shared_ptr<const Definition>> LoadDefinition(
    const campaign::MethodList& methods, store::Reader& reader,
    const store::NewCampaign& submitted) {
  ASSIGN_OR_RETURN(const auto files, reader.Files(submitted.id));
  absl::Status unread;
  campaign::ReadOutcome outcome = campaign::ReadCampaign(
      methods, submitted.yaml, submitted.file_name, StoredFiles(reader, files, &unread),
      submitted.seed, campaign::StoredUnder(submitted.reading_rules));
  RETURN_IF_ERROR(unread);
  if (!outcome.problems.empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat("this program refuses the campaign as submitted: ",
                     campaign::ToString(outcome.problems.front())));
  }
  return MakeDefinition(std::move(outcome.campaign));
}

}  // namespace calib::planning
