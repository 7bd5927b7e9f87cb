#include "server/service/submission.h"

#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "proto/rpc/check_message.h"
#include "proto/rpc/digest.h"
#include "server/campaign/file/campaign_file.h"
#include "server/campaign/model/race.h"
#include "server/messages/attempt_spec.h"
#include "server/methods/registry.h"
#include "server/planning/definition.h"
#include "server/planning/history.h"
#include "server/service/queries.h"

namespace calib::service {
namespace {

/// What a campaign asks for beyond what the server takes, a sentence each.
std::vector<campaign::Problem> BeyondLimits(const campaign::Campaign& campaign,
                                            const std::string& file, const Limits& limits) {
  std::vector<campaign::Problem> problems;
  const auto limit = [&](const char* key, std::int64_t found, std::int64_t most, const char* of,
                         const char* option) {
    if (found > most) {
      problems.push_back(
          {.file = file,
           .line = 0,
           .key = key,
           .message = absl::StrCat(found, " ", of, ", and this server takes at most ", most,
                                   " (calibd --", option, ")")});
    }
  };
  const std::int64_t samples =
      campaign.precomputed.has_value() ? campaign.precomputed->parameters.rows() : campaign.samples;
  std::int64_t readings = 0;
  std::int64_t packings = 0;
  std::int64_t grains = 0;
  for (const campaign::Experiment& experiment : campaign.experiments) {
    for (const campaign::MeasuredObservable& observable : experiment.observables) {
      readings += static_cast<std::int64_t>(observable.values.size());
    }
    packings += static_cast<std::int64_t>(experiment.specimens.size());
    for (const campaign::Specimen& specimen : experiment.specimens) {
      if (const auto* packing = std::get_if<campaign::PackingFile>(&specimen)) {
        grains += static_cast<std::int64_t>(packing->packing.radius.size());
      }
    }
  }
  limit("inference.samples", samples, limits.samples, "samples", "max-samples");
  limit("experiments", readings, limits.readings, "readings", "max-readings");
  if (problems.empty()) {
    limit("inference.samples", samples * readings, limits.predictions,
          "predictions (samples times readings)", "max-predictions");
  }
  limit("experiments", packings, limits.packings, "packings", "max-packings");
  limit("experiments", grains, limits.grains, "grains in packing files", "max-grains");
  return problems;
}

/// What no worker would take, by the rules of a run's fields (proto/rpc/check_message.h).
std::vector<campaign::Problem> BeyondRules(const campaign::Campaign& campaign,
                                           const std::string& file) {
  if (campaign.precomputed.has_value()) {
    return {};
  }
  std::vector<campaign::RunOf> runs = {{.values = campaign::MiddleValues(campaign), .stream = 0}};
  for (const std::string& effect : campaign.race) {
    runs.push_back({.values = campaign::MiddleValues(campaign, {effect}), .stream = 0});
  }
  for (std::size_t e = 0; e < campaign.experiments.size(); ++e) {
    for (const campaign::RunOf& run : runs) {
      const v1::Lease lease = messages::LeaseOf(campaign, static_cast<int>(e), run);
      const absl::Status status = lease.has_program() ? rpc::CheckMessage(lease.program())
                                                      : rpc::CheckMessage(lease.spec());
      if (!status.ok()) {
        return {{.file = file,
                 .line = 0,
                 .key = "experiments",
                 .message = absl::StrCat(campaign.experiments[e].name,
                                         ": workers are told of it as ", status.message())}};
      }
    }
  }
  return {};
}

v1::SubmitReply Refused(const std::vector<campaign::Problem>& problems) {
  v1::SubmitReply reply;
  for (const campaign::Problem& problem : problems) {
    v1::Problem& message = *reply.add_problems();
    message.set_file(problem.file);
    message.set_line(problem.line);
    message.set_key(problem.key);
    message.set_message(problem.message);
  }
  return reply;
}

}  // namespace

absl::StatusOr<std::variant<store::NewCampaign, v1::SubmitReply>> CheckSubmission(
    const v1::SubmitRequest& request, const Limits& limits, store::Reader& reader) {
  const std::map<std::string, std::string> files(request.files().begin(), request.files().end());
  std::int64_t bytes = 0;
  for (const auto& [path, digest] : files) {
    const auto of_file = reader.BlobBytes(digest);
    if (absl::IsNotFound(of_file.status())) {
      return absl::FailedPreconditionError(
          absl::StrCat("the content of ", path, " (SHA-256 ", digest, ") was not put"));
    }
    RETURN_IF_ERROR(of_file.status());
    bytes += *of_file;
  }
  if (bytes > limits.campaign_mib << 20) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "the files of the campaign have ", bytes, " bytes, and this server takes at most ",
        limits.campaign_mib, " MiB (calibd --max-campaign-mib)"));
  }
  std::optional<std::uint64_t> seed;
  if (request.has_seed()) {
    seed = request.seed();
  }
  absl::Status unread;
  const campaign::ReadOutcome outcome = campaign::ReadCampaign(
      methods::All(), request.campaign_file(), request.file_name(),
      planning::StoredFiles(reader, files, &unread), seed, campaign::CampaignIs::kNew,
      {.covariance = static_cast<std::size_t>(limits.covariance)});
  RETURN_IF_ERROR(unread);
  if (!outcome.problems.empty()) {
    return Refused(outcome.problems);
  }
  const campaign::Campaign& campaign = outcome.campaign;
  for (const auto& problems : {BeyondLimits(campaign, request.file_name(), limits),
                               BeyondRules(campaign, request.file_name())}) {
    if (!problems.empty()) {
      return Refused(problems);
    }
  }
  store::NewCampaign accepted{.name = campaign.name,
                              .yaml = request.campaign_file(),
                              .file_name = request.file_name(),
                              .seed = seed,
                              .method = campaign.method->name(),
                              .samples = planning::LargestIteration(campaign),
                              .max_iterations = campaign.method->MostBatches(campaign),
                              .reading_rules = campaign::kReadingRules};
  if (campaign.lineage.has_value()) {  // its data are the parent's, as they were read there
    const auto parent = ParseCampaign(campaign.lineage->parent);
    const auto record = parent.ok() ? reader.Campaign(*parent)
                                    : absl::StatusOr<store::CampaignRecord>(parent.status());
    if (record.ok()) {
      accepted.reading_rules = record->submitted.reading_rules;
    }
  }
  if (campaign.precomputed.has_value()) {
    accepted.samples = static_cast<int>(campaign.precomputed->parameters.rows());
  }
  return accepted;
}

absl::StatusOr<NewFinding> CheckFinding(const v1::AddFindingRequest& request, std::int64_t unix_ms,
                                        store::Reader& reader) {
  constexpr std::size_t kLongestKind = 32;
  const std::string& kind = request.kind();
  if (kind.empty() || kind.size() > kLongestKind ||
      kind.find_first_not_of("abcdefghijklmnopqrstuvwxyz_") != std::string::npos) {
    return absl::InvalidArgumentError(
        absl::StrCat("a finding is of a kind of 1 to ", kLongestKind, " of the letters a-z and _"));
  }
  ASSIGN_OR_RETURN(const auto campaign, ParseCampaign(request.campaign()));
  ASSIGN_OR_RETURN(const auto there, reader.HasBlob(request.digest()));
  ASSIGN_OR_RETURN(const auto before, FindingsOf(reader, campaign));
  if (!there) {
    return absl::FailedPreconditionError(
        absl::StrCat("the document of the finding (SHA-256 ", request.digest(), ") was not put"));
  }
  NewFinding finding{
      .campaign = campaign,
      .record = {.kind = kind, .digest = request.digest(), .created_unix_ms = unix_ms}};
  for (const v1::Finding& earlier : before.findings()) {
    if (earlier.kind() == kind && earlier.digest() == request.digest()) {
      finding.record.created_unix_ms = earlier.created_unix_ms();
    }
  }
  return finding;
}

absl::StatusOr<planning::NewRuns> CheckRuns(const v1::AddRunsRequest& request) {
  ASSIGN_OR_RETURN(const auto campaign, ParseCampaign(request.campaign()));
  const auto stage = campaign::ValueOf(campaign::kSamplePurposeWords, request.stage());
  if (!stage || !campaign::IsStageOfDesign(*stage)) {
    std::vector<std::string> stages;
    for (const auto& word : campaign::kSamplePurposeWords) {
      if (campaign::IsStageOfDesign(word.value)) stages.emplace_back(word.text);
    }
    return absl::InvalidArgumentError(
        absl::StrCat(request.stage(), " is no stage of a design: ", absl::StrJoin(stages, ", ")));
  }
  if (request.rows().empty()) {
    return absl::InvalidArgumentError("a batch without a row adds nothing");
  }
  planning::NewRuns runs{
      .campaign = campaign,
      .iteration = request.iteration(),
      .stage = *stage,
      .experiments = {request.experiments().begin(), request.experiments().end()}};
  for (const v1::AddRunsRequest::Row& row : request.rows()) {
    runs.rows.push_back(
        {.values = {row.parameters().begin(), row.parameters().end()}, .stream = row.stream()});
  }
  return runs;
}

std::string ContentDigest(const v1::SubmitRequest& request) {
  rpc::Sha256 digest;
  const auto add = [&digest](const std::string& part) {
    digest.Update(absl::StrCat(part.size(), ":"));
    digest.Update(part);
  };
  add(request.campaign_file());
  add(request.file_name());
  for (const auto& [path, content] :
       std::map<std::string, std::string>(request.files().begin(), request.files().end())) {
    add(path);
    add(content);
  }
  add(request.has_seed() ? absl::StrCat(request.seed()) : "");
  return digest.Finish();
}

}  // namespace calib::service
