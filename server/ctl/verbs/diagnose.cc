#include <iostream>

#include "absl/strings/str_cat.h"
#include "server/client/findings.h"
#include "server/client/interrupt.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/next_step.h"
#include "server/ctl/verbs.h"
#include "server/diagnosis/diagnosis.h"
#include "server/diagnosis/diagnosis_support.h"

namespace calib::ctl {
namespace {

std::string Next(const Arguments& arguments, const report::CampaignView& view,
                 const diagnosis::Diagnosis& diagnosis) {
  const std::string& id = arguments.campaign;
  if (diagnosis.verdict == "adequate" || view.campaign.precomputed) {
    return NextStep(CommandOf(arguments, absl::StrCat("report ", id, " -o ", id, ".html")),
                    "this verdict with parameters and curves, in one file");
  }
  if (diagnosis.verdict == "unexplained" && diagnosis.best_partial.empty()) {
    return NextStep(CommandOf(arguments, "compare " + id),
                    "where the model fails; an effect of your own may be declared in the file");
  }
  std::string improve = "improve " + id;
  for (const std::string& name : arguments.effects) absl::StrAppend(&improve, " --without ", name);
  return NextStep(CommandOf(arguments, improve),
                  "the effect added and fitted, judged on data that took no part");
}

}  // namespace

int Diagnose(const Arguments& arguments) {
  client::CatchInterrupts();
  const auto session = client::Session::Open(arguments.server);
  if (!session.ok()) return Fail(session.status());
  client::Laboratory laboratory(**session, arguments.server);
  const auto view = laboratory.Finished(arguments.campaign);
  if (!view.ok()) return Fail(view.status());
  if (auto status = diagnosis::CheckLeftOut(arguments.effects, view->campaign); !status.ok()) {
    return Fail(status);
  }
  const auto diagnosis = diagnosis::Diagnose(laboratory, *view, {.without = arguments.effects});
  if (!diagnosis.ok()) return Fail(diagnosis.status());
  client::KeepFinding((*session)->client(), arguments.campaign, client::kDiagnosis,
                      diagnosis::DiagnosisJson(*diagnosis));
  std::cout << (arguments.json
                    ? diagnosis::DiagnosisJson(*diagnosis)
                    : diagnosis::DiagnosisText(*diagnosis) + Next(arguments, *view, *diagnosis));
  return kDone;
}

}  // namespace calib::ctl
