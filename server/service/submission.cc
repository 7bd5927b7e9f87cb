#include "server/service/submission.h"

#include <map>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "proto/rpc/digest.h"
#include "server/campaign/file/campaign_file.h"
#include "server/scheduler/definition.h"
#include "server/service/queries.h"

namespace calib::service {
absl::StatusOr<std::variant<store::NewCampaign, v1::SubmitReply>> CheckSubmission(
    const v1::SubmitRequest& request, store::Reader& reader) {
  const std::map<std::string, std::string> files(request.files().begin(), request.files().end());
  for (const auto& [path, digest] : files) {
    ASSIGN_OR_RETURN(const auto there, reader.HasBlob(digest));
    if (!there) {
      return absl::FailedPreconditionError(
          absl::StrCat("the content of ", path, " (SHA-256 ", digest, ") was not put"));
    }
  }
  std::optional<std::uint64_t> seed;
  if (request.has_seed()) {
    seed = request.seed();
  }
  const campaign::ReadOutcome outcome = campaign::ReadCampaign(
      request.campaign_file(), request.file_name(), scheduler::StoredFiles(reader, files), seed);
  if (!outcome.problems.empty()) {
    v1::SubmitReply reply;
    for (const campaign::Problem& problem : outcome.problems) {
      v1::Problem& message = *reply.add_problems();
      message.set_file(problem.file);
      message.set_line(problem.line);
      message.set_key(problem.key);
      message.set_message(problem.message);
    }
    return reply;
  }
  const campaign::Campaign& campaign = outcome.campaign;
  store::NewCampaign accepted{.name = campaign.name,
                              .yaml = request.campaign_file(),
                              .file_name = request.file_name(),
                              .seed = seed,
                              .method = campaign.method,
                              .samples = campaign.samples,
                              .max_iterations = campaign::MostBatches(campaign)};
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
