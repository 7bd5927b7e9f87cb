#include "server/ctl/source_files.h"

#include <filesystem>
#include <iostream>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/campaign/model/identity.h"
#include "server/campaign/model/sha256.h"
#include "server/methods/registry.h"
#include "server/report/documents/json_documents.h"

namespace calib::ctl {
namespace {

void Print(const std::vector<campaign::Problem>& problems, bool json) {
  if (json) {
    std::cout << report::ProblemsJson(problems);
    return;
  }
  for (const campaign::Problem& problem : problems) {
    std::cerr << campaign::ToString(problem) << "\n";
  }
}

}  // namespace

std::optional<SourceFiles> ReadSourceFiles(const std::string& file,
                                           std::optional<std::uint64_t> seed, bool json) {
  SourceFiles source;
  const std::filesystem::path path(file);
  source.file_name = path.filename().string();
  auto yaml = campaign::DiskReader("")(file);
  if (!yaml.ok()) {
    Print({{.file = file,
            .line = 0,
            .key = "",
            .message = absl::StrCat("cannot be read: ", yaml.status().message())}},
          json);
    return std::nullopt;
  }
  source.yaml = *std::move(yaml);
  const campaign::FileReader disk = campaign::DiskReader(file);
  const campaign::FileReader remember = [&disk, &source](const std::string& name) {
    auto content = disk(name);
    if (content.ok()) source.contents[name] = *content;
    return content;
  };
  source.outcome = campaign::ReadCampaign(methods::All(), source.yaml, file, remember, seed);
  if (!source.outcome.problems.empty()) {
    Print(source.outcome.problems, json);
    return std::nullopt;
  }
  return source;
}

absl::Status CancelledBefore(const std::string& campaign) {
  return absl::AbortedError(absl::StrCat(campaign,
                                         ", the same file, is cancelled; `calibctl delete ",
                                         campaign, "` or another --seed starts it anew"));
}

absl::StatusOr<std::string> SubmitSource(client::Client& client, const SourceFiles& source,
                                         std::optional<std::uint64_t> seed,
                                         const std::string& file) {
  v1::SubmitRequest request;
  request.set_campaign_file(source.yaml);
  request.set_file_name(source.file_name);
  if (seed) request.set_seed(*seed);
  campaign::Submission submission{
      .campaign_file = source.yaml, .file_name = source.file_name, .files = {}, .seed = seed};
  for (const auto& [path, content] : source.contents) {
    RETURN_IF_ERROR(client.PutBlob(content));
    submission.files[path] = campaign::Sha256Hex(content);
    (*request.mutable_files())[path] = submission.files[path];
  }
  request.set_request_id(campaign::IdentityDigest(submission));
  ASSIGN_OR_RETURN(const auto reply, client.Submit(request));
  if (reply.problems().empty()) return reply.campaign();
  for (const v1::Problem& problem : reply.problems()) {
    std::cerr << campaign::ToString(
                     {problem.file(), problem.line(), problem.key(), problem.message()})
              << "\n";
  }
  return absl::InvalidArgumentError(absl::StrCat(
      "the server refuses ", file, ", which this program accepts: are both of one build?"));
}

}  // namespace calib::ctl
