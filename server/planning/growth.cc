#include "server/planning/growth.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "server/campaign/model/race.h"
#include "server/planning/definition.h"
#include "server/planning/requests.h"

namespace calib::planning {
namespace {

// Indices in the order of the file.
absl::StatusOr<std::vector<int>> ExperimentsFor(const Definition& definition, const NewRuns& runs) {
  if (runs.experiments.empty()) return definition.ExperimentsOf(campaign::Role::kCalibrate);
  std::vector<int> indices;
  std::vector<std::string> known;
  const auto& experiments = definition.campaign.experiments;
  for (std::size_t e = 0; e < experiments.size(); ++e) {
    known.push_back(experiments[e].name);
    const auto named =
        std::count(runs.experiments.begin(), runs.experiments.end(), experiments[e].name);
    if (named > 1) {
      return absl::InvalidArgumentError(absl::StrCat(experiments[e].name, " is named twice"));
    }
    if (named == 1) indices.push_back(static_cast<int>(e));
  }
  if (indices.size() < runs.experiments.size()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "of the experiments ", absl::StrJoin(runs.experiments, ", "), " some are not in campaign c",
        runs.campaign, ", which has ", absl::StrJoin(known, ", ")));
  }
  return indices;
}

// What is kept of a batch beside its rows.
std::string BatchToJson(const NewRuns& runs, const std::vector<int>& experiments) {
  return nlohmann::json{{"stage", ToString(runs.stage)}, {"experiments", experiments}}.dump();
}

// Whether these are the rows that are stored of the batch.
absl::StatusOr<bool> IsStored(store::Reader& reader, const NewRuns& runs) {
  ASSIGN_OR_RETURN(auto samples, reader.Samples(runs.campaign));
  std::erase_if(samples, [&runs](const store::SampleRecord& sample) {
    return sample.iteration != runs.iteration;
  });
  return std::equal(samples.begin(), samples.end(), runs.rows.begin(), runs.rows.end(),
                    [](const store::SampleRecord& sample, const campaign::RunOf& row) {
                      return sample.parameters == row.values && sample.stream == row.stream;
                    });
}

absl::Status CheckRows(const campaign::Campaign& campaign, const NewRuns& runs) {
  if (runs.rows.empty() || runs.rows.size() > campaign::kMostRowsOfBatch) {
    return absl::InvalidArgumentError(absl::StrCat(
        "a batch of ", runs.rows.size(), " rows; allowed: 1 to ", campaign::kMostRowsOfBatch));
  }
  for (std::size_t i = 0; i < runs.rows.size(); ++i) {
    if (std::string why = campaign::WhyNotRun(campaign, runs.rows[i].values); !why.empty()) {
      return absl::InvalidArgumentError(absl::StrCat("row ", i, ": ", why));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Growth> PlanGrowth(const campaign::MethodList& methods, store::Reader& reader,
                                  const NewRuns& runs) {
  ASSIGN_OR_RETURN(const auto record, reader.Campaign(runs.campaign));
  ASSIGN_OR_RETURN(const auto definition, LoadDefinition(methods, reader, record.submitted));
  if (!campaign::RunsAreAdded(definition->campaign)) {
    return absl::InvalidArgumentError(absl::StrCat("campaign c", runs.campaign, " is of method ",
                                                   record.submitted.method,
                                                   "; runs are added to a design alone"));
  }
  ASSIGN_OR_RETURN(const auto experiments, ExperimentsFor(*definition, runs));
  ASSIGN_OR_RETURN(const auto iterations, reader.Iterations(runs.campaign));
  const std::string proposal = BatchToJson(runs, experiments);
  const auto there = static_cast<int>(iterations.size());
  if (runs.iteration < there) {
    ASSIGN_OR_RETURN(const bool same_rows, IsStored(reader, runs));
    if (same_rows && iterations[static_cast<std::size_t>(runs.iteration)].proposal == proposal) {
      return Growth{.is_there = true};
    }
    return absl::AlreadyExistsError(absl::StrCat("batch ", runs.iteration, " of campaign c",
                                                 runs.campaign, " is there with other runs"));
  }
  Growth growth;
  ASSIGN_OR_RETURN(growth.progress.state, Next(record.progress.state, CampaignEvent::kGrow));
  if (runs.iteration > there) {
    return absl::FailedPreconditionError(absl::StrCat("campaign c", runs.campaign, " has ", there,
                                                      " batches, so the next is ", there,
                                                      " and not ", runs.iteration));
  }
  RETURN_IF_ERROR(CheckRows(definition->campaign, runs));
  growth.progress.iteration = runs.iteration;
  Requests requests(*definition, runs.campaign, reader, growth.plan);
  Start start{.iteration = runs.iteration, .proposal = proposal, .samples = {}};
  for (std::size_t i = 0; i < runs.rows.size(); ++i) {
    start.samples.push_back(
        {.sample = runs.iteration * campaign::kMostRowsOfBatch + static_cast<int>(i),
         .iteration = runs.iteration,
         .parameters = runs.rows[i].values,
         .stream = runs.rows[i].stream});
    RETURN_IF_ERROR(requests.Run(start.samples.back(), experiments));
  }
  growth.plan.start = std::move(start);
  growth.plan.log.push_back(absl::StrCat(ToString(CampaignEvent::kGrow), ": batch ", runs.iteration,
                                         " (", ToString(runs.stage), "), ", runs.rows.size(),
                                         runs.rows.size() == 1 ? " run" : " runs"));
  return growth;
}

campaign::SamplePurpose StageIn(const std::string& proposal) {
  const auto json = nlohmann::json::parse(proposal, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return campaign::SamplePurpose::kEnsemble;
  const auto stage = json.find("stage");
  if (stage == json.end() || !stage->is_string()) return campaign::SamplePurpose::kEnsemble;
  return campaign::ValueOf(campaign::kSamplePurposeWords, stage->get<std::string>())
      .value_or(campaign::SamplePurpose::kEnsemble);
}

}  // namespace calib::planning
