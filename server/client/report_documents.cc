#include "server/client/report_documents.h"

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

// The campaign that an improvement ended in; empty: the document is none.
std::string EndOf(const std::string& improvement) {
  const auto json = nlohmann::json::parse(improvement, nullptr, false);
  if (!json.is_object() || !json.contains("final_campaign")) return "";
  const auto& end = json["final_campaign"];
  return end.is_string() ? end.get<std::string>() : "";
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
  const std::string last = EndOf(*improvement);
  if (last.empty() || last == campaign) return documents;
  const std::string there = "campaigns/" + last;
  RETURN_IF_ERROR(Add(documents, there, ShowDocument(client, last)));
  RETURN_IF_ERROR(Add(documents, there + "/compare", CompareDocument(client, last)));
  return documents;
}

}  // namespace calib::client
