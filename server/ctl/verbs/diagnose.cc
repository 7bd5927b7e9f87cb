#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/campaign/file/campaign_file.h"
#include "server/client/findings.h"
#include "server/client/interrupt.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/next_step.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"
#include "server/diagnosis/diagnosis.h"
#include "server/diagnosis/diagnosis_support.h"
#include "server/diagnosis/plan_json.h"

namespace calib::ctl {
namespace {

struct DiagnoseOptions {
  std::string campaign;
  std::vector<std::string> without{};  ///< effects that are not to be thought of
  std::string design{};                ///< id of another campaign's design
  bool gate = false;
  std::string then{};  ///< file of the proposed measurement
  std::optional<int> plan{};
  bool no_plan = false;
};

std::string Next(const CommonOptions& common, const DiagnoseOptions& options,
                 const report::CampaignView& view, const diagnosis::Diagnosis& found) {
  const std::string& id = options.campaign;
  using diagnosis::AnswerVerdict;
  const AnswerVerdict verdict = found.answer.verdict;
  if (verdict == AnswerVerdict::kAdequate || view.campaign.precomputed) {
    return NextStep(CommandOf(common.server, absl::StrCat("report ", id, " -o ", id, ".html")),
                    "this verdict with parameters and curves, in one file");
  }
  if (found.only_adequacy) {
    return NextStep(CommandOf(common.server, "diagnose " + id), "which effect it lacks");
  }
  if (verdict == AnswerVerdict::kUnexplained) {
    return NextStep(CommandOf(common.server, "compare " + id),
                    "where the model fails; an effect of your own may be declared in the file");
  }
  std::string improve = "improve " + id;
  for (const std::string& name : options.without) absl::StrAppend(&improve, " --without ", name);
  return NextStep(CommandOf(common.server, improve),
                  "the effect added and fitted, judged on data that took no part");
}

void Declare(OptionList& list, DiagnoseOptions& options) {
  list.Campaign(options.campaign);
  list.Texts("--without", options.without, "effect that is not to be thought of");
  list.Text("--design", options.design,
            "id of another campaign's design of the same tests (`design.campaign` of its JSON), "
            "whose runs serve this one too");
  list.Flag("--no-plan", options.no_plan,
            "proposes no next experiment, which takes runs of its own");
  const Option gate = list.Flag("--gate", options.gate,
                                "adequate or not, by the runs that are there; tries no effect");
  list.Text("--then", options.then,
            "file of the proposed measurement, once it is made: the answer with both")
      .Excludes(gate);
  list.WholeNumber("--plan", options.plan,
                   "which of what was considered that file is, from 0, the best [0]");
}

// The newest answer that has proposals, as it was kept.
absl::StatusOr<nlohmann::json> AnswerWithProposals(client::Client& client,
                                                   const std::string& campaign) {
  ASSIGN_OR_RETURN(const auto findings, client.Findings(campaign));
  nlohmann::json newest;
  std::int64_t when = -1;
  for (const v1::Finding& finding : findings) {
    if (finding.kind() != client::kDiagnosis || finding.created_unix_ms() < when) continue;
    ASSIGN_OR_RETURN(const auto document, client.GetBlob(finding.digest()));
    auto json = nlohmann::json::parse(document, nullptr, false);
    if (!json.is_object() || !json["next_experiment"].is_object()) continue;
    when = finding.created_unix_ms();
    newest = std::move(json);
  }
  if (when < 0) {
    return absl::FailedPreconditionError(absl::StrCat("no measurement has been proposed for ",
                                                      campaign, "; `calibctl diagnose ", campaign,
                                                      "` does where the model is not adequate"));
  }
  return newest;
}

// One of its proposals; the question becomes the one that was asked then.
absl::StatusOr<diagnosis::PlannedExperiment> ProposalOf(const nlohmann::json& answer, int number,
                                                        diagnosis::DiagnosisOptions& question) {
  try {
    const nlohmann::json& considered = answer.at("next_experiment").at("considered");
    if (number >= static_cast<int>(considered.size())) {
      return absl::InvalidArgumentError(
          absl::StrCat("--plan ", number, ": ", considered.size(), " were considered, from 0 on"));
    }
    if (question.without.empty()) question.without = answer.value("without", question.without);
    if (question.design.empty())
      question.design = answer.at("design").value("borrowed_from", question.design);
    return diagnosis::PlannedFrom(considered.at(static_cast<std::size_t>(number)));
  } catch (const nlohmann::json::exception&) {
    return absl::FailedPreconditionError(
        "the proposals that are kept are of another build; `calibctl diagnose` makes new ones");
  }
}

// The proposal that the file is a measurement of.
absl::StatusOr<diagnosis::MadeMeasurement> MadeOf(client::Client& client,
                                                  const DiagnoseOptions& options,
                                                  diagnosis::DiagnosisOptions& question) {
  const std::string name = std::filesystem::path(options.then).filename().string();
  auto content = campaign::DiskReader(options.then)(name);
  if (!content.ok())
    return absl::InvalidArgumentError(absl::StrCat(options.then, ": ", content.status().message()));
  ASSIGN_OR_RETURN(const nlohmann::json answer, AnswerWithProposals(client, options.campaign));
  ASSIGN_OR_RETURN(auto plan, ProposalOf(answer, options.plan.value_or(0), question));
  return diagnosis::MadeMeasurement{
      .plan = std::move(plan), .file = name, .content = *std::move(content)};
}

absl::StatusOr<int> Diagnose(const CommonOptions& common, const DiagnoseOptions& options) {
  if (options.plan && options.then.empty())
    return absl::InvalidArgumentError("--plan: says which proposal the file of --then measures");
  client::CatchInterrupts();
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  client::Laboratory laboratory(*session, common.server);
  ASSIGN_OR_RETURN(const auto view, laboratory.Finished(options.campaign));
  diagnosis::DiagnosisOptions question{.only_adequacy = options.gate,
                                       .without = options.without,
                                       .design = options.design,
                                       .next_experiment = !options.no_plan};
  if (!options.then.empty()) {
    ASSIGN_OR_RETURN(question.then, MadeOf(session->client(), options, question));
  }
  RETURN_IF_ERROR(diagnosis::CheckLeftOut(question.without, view.campaign));
  ASSIGN_OR_RETURN(const auto diagnosis, diagnosis::Diagnose(laboratory, view, question));
  client::StoreFinding(session->client(), options.campaign, client::kDiagnosis,
                       diagnosis::DiagnosisJson(diagnosis));
  std::cout << (common.json
                    ? diagnosis::DiagnosisJson(diagnosis)
                    : diagnosis::DiagnosisText(diagnosis) + Next(common, options, view, diagnosis));
  return kDone;
}

}  // namespace

Verb DiagnoseVerb() {
  return MakeVerb<DiagnoseOptions>(
      {.name = "diagnose",
       .description =
           "Which physical effect is missing; runs what it needs, and goes on when killed",
       .example = "diagnose c1 --state calib-state",
       .speaks_of_errors = true},
      &Declare, &Diagnose);
}

}  // namespace calib::ctl
