#include <iostream>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/client/findings.h"
#include "server/client/interrupt.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/next_step.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"
#include "server/diagnosis/diagnosis.h"
#include "server/diagnosis/diagnosis_support.h"

namespace calib::ctl {
namespace {

struct DiagnoseOptions {
  std::string campaign;
  std::vector<std::string> without{};  ///< effects that are not to be thought of
  std::string design{};                ///< id of another campaign's design
  bool gate = false;
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
  list.Flag("--gate", options.gate, "adequate or not, by the runs that are there; tries no effect");
}

absl::StatusOr<int> Diagnose(const CommonOptions& common, const DiagnoseOptions& options) {
  client::CatchInterrupts();
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  client::Laboratory laboratory(*session, common.server);
  ASSIGN_OR_RETURN(const auto view, laboratory.Finished(options.campaign));
  RETURN_IF_ERROR(diagnosis::CheckLeftOut(options.without, view.campaign));
  ASSIGN_OR_RETURN(const auto diagnosis,
                   diagnosis::Diagnose(laboratory, view,
                                       {.only_adequacy = options.gate,
                                        .without = options.without,
                                        .design = options.design,
                                        .next_experiment = !options.no_plan}));
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
