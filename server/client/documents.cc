#include "server/client/documents.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/client/findings.h"
#include "server/client/load_view.h"
#include "server/messages/read_words.h"
#include "server/report/documents/json_documents.h"
#include "server/report/views/discrepancies.h"
#include "server/report/views/lineage.h"
#include "server/report/views/next_command.h"
#include "server/report/views/parameter_drift.h"
#include "server/report/views/stored_diagnosis.h"
#include "server/report/views/warnings.h"

namespace calib::client {
namespace {

absl::StatusOr<CampaignShelf::Read> ReadCampaign(Client& client, const std::string& campaign,
                                                 CampaignShelf* shelf) {
  CampaignShelf own;
  ASSIGN_OR_RETURN(const auto source, client.GetSource(campaign));
  return (shelf != nullptr ? *shelf : own).Get(client, source);
}

/// The documents of a kind that are kept with a campaign.
struct Kept {
  std::map<std::string, std::string> documents{};    // by digest
  std::string last{};                                // digest
  std::vector<report::StoredDiagnosis> diagnoses{};  // those of them that can be read
};

absl::StatusOr<Kept> KeptOf(Client& client, const std::vector<v1::Finding>& findings,
                            const std::string& kind) {
  Kept kept;
  for (const v1::Finding& finding : findings) {
    if (finding.kind() != kind) continue;
    kept.last = finding.digest();
    ASSIGN_OR_RETURN(const std::string document, client.GetBlob(kept.last));
    kept.documents[kept.last] = document;
    if (kind != kDiagnosis) continue;
    auto diagnosis = report::ReadDiagnosis(document);
    if (!diagnosis.ok()) continue;
    diagnosis->digest = kept.last;
    kept.diagnoses.push_back(*std::move(diagnosis));
  }
  return kept;
}

}  // namespace

absl::StatusOr<std::string> ListDocument(Client& client, const Client::Part& part) {
  ASSIGN_OR_RETURN(const auto campaigns, client.List(part));
  return report::StatusListJson(campaigns);
}

absl::StatusOr<std::vector<std::string>> WarningsOf(Client& client, const std::string& campaign) {
  const auto posterior = client.GetPosterior(campaign, std::nullopt);
  if (absl::IsFailedPrecondition(posterior.status())) return std::vector<std::string>();
  RETURN_IF_ERROR(posterior.status());
  return std::vector<std::string>(posterior->warnings().begin(), posterior->warnings().end());
}

absl::StatusOr<std::string> ShowDocument(Client& client, const std::string& campaign) {
  report::Shown shown;
  ASSIGN_OR_RETURN(shown.status, client.Show(campaign));
  ASSIGN_OR_RETURN(const auto campaigns, client.List({.parent = campaign}));
  shown.children = report::ChildrenOf(campaigns, campaign);
  ASSIGN_OR_RETURN(shown.findings, client.Findings(campaign));
  ASSIGN_OR_RETURN(shown.warnings, WarningsOf(client, campaign));
  ASSIGN_OR_RETURN(const Kept kept, KeptOf(client, shown.findings, kDiagnosis));
  const bool improved =
      std::any_of(shown.findings.begin(), shown.findings.end(),
                  [](const v1::Finding& finding) { return finding.kind() == kImprovement; });
  shown.next_command =
      report::NextCommand(shown.status, report::LatestOf(kept.diagnoses, campaign), improved);
  return report::ShownJson(shown);
}

absl::StatusOr<std::vector<report::Branch>> FamilyOf(Client& client, const std::string& campaign) {
  ASSIGN_OR_RETURN(const auto campaigns, client.List());
  auto family = report::FamilyOf(campaigns, campaign);
  if (family.empty()) {
    return absl::NotFoundError(
        absl::StrCat("there is no campaign \"", campaign, "\" (ids are like c1; see list)"));
  }
  return family;
}

absl::StatusOr<std::string> LineageDocument(Client& client, const std::string& campaign) {
  ASSIGN_OR_RETURN(const auto family, FamilyOf(client, campaign));
  return report::LineageJson(campaign, family);
}

absl::StatusOr<std::string> PosteriorDocument(Client& client, const std::string& campaign,
                                              std::optional<int> iteration, CampaignShelf* shelf) {
  ASSIGN_OR_RETURN(const auto posterior, client.GetPosterior(campaign, iteration));
  ASSIGN_OR_RETURN(const auto read, ReadCampaign(client, campaign, shelf));
  // Weights are known in the last posterior alone.
  std::vector<v1::Sample> samples;
  if (posterior.draws().empty() && posterior.iteration() + 1 == posterior.iterations()) {
    ASSIGN_OR_RETURN(samples, client.GetSamples(campaign));
  }
  return report::PosteriorJson(posterior, read->parameters,
                               report::ShapeOf(posterior, read->parameters, samples));
}

absl::StatusOr<std::string> SamplesDocument(Client& client, const std::string& campaign,
                                            CampaignShelf* shelf) {
  ASSIGN_OR_RETURN(const auto samples, client.GetSamples(campaign));
  ASSIGN_OR_RETURN(const auto read, ReadCampaign(client, campaign, shelf));
  return report::SamplesJson(campaign, read->parameters, samples);
}

absl::StatusOr<std::string> StatesDocument(Client& client, const std::string& campaign,
                                           int sample) {
  ASSIGN_OR_RETURN(auto states, LoadStates(client, campaign, sample));
  std::map<std::string, report::StateHistory> by_experiment;
  for (auto& [key, history] : states) by_experiment[key.first] = std::move(history);
  return report::StatesJson(campaign, sample, by_experiment);
}

absl::StatusOr<std::string> WorkersDocument(Client& client) {
  ASSIGN_OR_RETURN(const auto workers, client.ListWorkers());
  return report::WorkersJson(workers);
}

absl::StatusOr<std::string> FindingDocument(Client& client, const std::string& campaign,
                                            const std::string& kind) {
  ASSIGN_OR_RETURN(const auto findings, client.Findings(campaign));
  ASSIGN_OR_RETURN(Kept kept, KeptOf(client, findings, kind));
  std::string digest = kept.last;
  if (const auto* latest = report::LatestOf(kept.diagnoses, campaign); latest != nullptr) {
    digest = latest->digest;
  }
  if (!digest.empty()) return std::move(kept.documents[digest]);
  return absl::NotFoundError(
      absl::StrCat("no ", kind, " of ", campaign, " has been made yet: `calibctl ",
                   kind == kDiagnosis ? "diagnose " : "improve ", campaign, "` makes one"));
}

absl::StatusOr<std::vector<report::StoredDiagnosis>> DiagnosesOf(Client& client,
                                                                 const std::string& campaign) {
  ASSIGN_OR_RETURN(const auto findings, client.Findings(campaign));
  ASSIGN_OR_RETURN(Kept kept, KeptOf(client, findings, kDiagnosis));
  return std::move(kept.diagnoses);
}

namespace {

// What is known before an iteration is complete: of states those of the runs that are drawn.
absl::StatusOr<Compared> CompareBefore(Client& client, v1::CampaignStatus status,
                                       CampaignShelf* shelf) {
  report::CampaignView view;
  view.status = std::move(status);
  const std::string& campaign = view.status.campaign();
  ASSIGN_OR_RETURN(const auto read, ReadCampaign(client, campaign, shelf));
  view.campaign = *read;
  ASSIGN_OR_RETURN(view.samples, client.GetSamples(campaign));
  for (const report::DrawnRun& run : report::RunsToDraw(view.samples)) {
    ASSIGN_OR_RETURN(auto states, LoadStates(client, campaign, run.sample));
    view.states.merge(states);
  }
  Compared compared;
  compared.comparison.rms_error = std::nan("");
  compared.curves = report::Curves(view, {});
  compared.comparison.note =
      absl::StrCat("No iteration of ", campaign, " is complete yet: nothing to compare.");
  return compared;
}

report::Comparison CompareView(const report::CampaignView& view,
                               const std::vector<report::ExperimentPrediction>& predictions) {
  report::Comparison comparison = report::Compare(view, predictions);
  report::AddDiscrepancies(view, predictions, comparison);
  comparison.prior_conflicts = report::PriorConflicts(view);
  // Parameters at a bound are among where it fails.
  std::vector<std::string> of_posterior = report::PosteriorWarnings(view);
  comparison.warnings.insert(comparison.warnings.begin(), of_posterior.begin(), of_posterior.end());
  if (auto drifts = report::ParameterDrifts(view); drifts.ok()) {
    comparison.parameter_drift = *std::move(drifts);
  } else {
    comparison.note += (comparison.note.empty() ? "" : " ") +
                       ("Drift of the parameters: " + std::string(drifts.status().message()) + ".");
  }
  return comparison;
}

}  // namespace

absl::StatusOr<Compared> CompareInFull(Client& client, const std::string& campaign,
                                       CampaignShelf* shelf) {
  ASSIGN_OR_RETURN(auto status, client.Show(campaign));
  if (status.infers_nothing()) {
    return absl::FailedPreconditionError(messages::InfersNothing(campaign, status.method()));
  }
  const auto posterior = client.GetPosterior(campaign, std::nullopt);
  if (absl::IsFailedPrecondition(posterior.status())) {
    return CompareBefore(client, std::move(status), shelf);
  }
  RETURN_IF_ERROR(posterior.status());
  ASSIGN_OR_RETURN(const auto view, LoadView(client, campaign, shelf));
  const auto predictions = report::PredictReadings(view);
  return Compared{.is_known = true,
                  .comparison = CompareView(view, predictions),
                  .curves = report::Curves(view, predictions)};
}

absl::StatusOr<std::string> CompareDocument(Client& client, const std::string& campaign,
                                            CampaignShelf* shelf) {
  ASSIGN_OR_RETURN(const auto compared, CompareInFull(client, campaign, shelf));
  return report::ComparisonJson(campaign, compared.comparison, compared.curves);
}

}  // namespace calib::client
