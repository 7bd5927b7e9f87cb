#include "server/client/report_documents.h"

#include <array>
#include <nlohmann/json.hpp>
#include <utility>

#include "calib/return_if_error.h"
#include "server/client/documents.h"
#include "server/client/findings.h"
#include "server/client/load_view.h"
#include "server/messages/read_words.h"
#include "server/report/documents/json_documents.h"
#include "server/report/documents/record.h"
#include "server/report/views/sensitivity.h"

namespace calib::client {
namespace {

// What does not exist, or not yet, is no part of a report.
absl::Status Add(report::DocumentsByPath& documents, const std::string& path,
                 absl::StatusOr<std::string> document) {
  if (document.ok()) {
    documents[path] = *std::move(document);
  } else if (!absl::IsNotFound(document.status()) &&
             !absl::IsFailedPrecondition(document.status())) {
    return document.status();
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> SensitivityOf(const report::CampaignView& view) {
  ASSIGN_OR_RETURN(const auto sensitivity, report::AnalyseCampaign(view));
  return report::SensitivityJson(view.status.campaign(), sensitivity);
}

// The campaigns that an improvement began with and ended in; empty ones: the document is none.
std::array<std::string, 2> EndsOf(const std::string& improvement) {
  const auto json = nlohmann::json::parse(improvement, nullptr, false);
  const auto name = [](const nlohmann::json& step) {
    const bool has = step.is_object() && step.contains("campaign") && step["campaign"].is_string();
    return has ? step["campaign"].get<std::string>() : std::string();
  };
  if (!json.is_object() || !json.contains("steps") || !json["steps"].is_array() ||
      json["steps"].empty()) {
    return {};
  }
  return {name(json["steps"].front()), name(json["steps"].back())};
}

}  // namespace

absl::StatusOr<report::DocumentsByPath> ReportDocuments(Client& client,
                                                        const std::string& campaign) {
  report::DocumentsByPath documents;
  CampaignShelf shelf;
  const std::string here = "campaigns/" + campaign;
  ASSIGN_OR_RETURN(documents[here], ShowDocument(client, campaign));
  ASSIGN_OR_RETURN(const auto view, LoadView(client, campaign, &shelf));
  documents[here + "/record"] = report::RecordJson(view);
  RETURN_IF_ERROR(Add(documents, here + "/lineage", LineageDocument(client, campaign)));
  RETURN_IF_ERROR(Add(documents, here + "/compare", CompareDocument(client, campaign, &shelf)));
  RETURN_IF_ERROR(
      Add(documents, here + "/diagnosis", FindingDocument(client, campaign, kDiagnosis)));
  auto improvement = FindingDocument(client, campaign, kImprovement);
  RETURN_IF_ERROR(Add(documents, here + "/improvement", improvement));
  if (view.posterior.parameters_size() > 0) {
    RETURN_IF_ERROR(Add(documents, here + "/posterior",
                        PosteriorDocument(client, campaign, std::nullopt, &shelf)));
    RETURN_IF_ERROR(Add(documents, here + "/sensitivity", SensitivityOf(view)));
  }
  if (!improvement.ok()) return documents;
  for (const std::string& end : EndsOf(*improvement)) {
    const std::string there = "campaigns/" + end;
    if (end.empty() || documents.contains(there)) continue;
    RETURN_IF_ERROR(Add(documents, there, ShowDocument(client, end)));
    RETURN_IF_ERROR(Add(documents, there + "/compare", CompareDocument(client, end)));
  }
  return documents;
}

}  // namespace calib::client
