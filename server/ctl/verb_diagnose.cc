#include <iostream>

#include "dem/formula/user_effect.h"
#include "server/ctl/diagnosis.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/findings.h"
#include "server/ctl/interrupt.h"
#include "server/ctl/verbs.h"

namespace calib::ctl {

int Diagnose(const Arguments& arguments) {
  CatchInterrupts();
  const auto session = Session::Open(arguments);
  if (!session.ok()) return Fail(session.status());
  Laboratory laboratory(**session, arguments);
  const auto view = laboratory.Finished(arguments.campaign);
  if (!view.ok()) return Fail(view.status());
  for (const std::string& name : arguments.effects) {
    if (dem::FindEffect(view->campaign.model.user_effects, name) == nullptr) {
      return Fail(absl::InvalidArgumentError("there is no effect " + name +
                                             " to leave out; see `calibctl effects`"));
    }
  }
  const auto diagnosis = Diagnose(laboratory, *view, {.without = arguments.effects});
  if (!diagnosis.ok()) return Fail(diagnosis.status());
  KeepFinding((*session)->client(), arguments.campaign, kDiagnosis, DiagnosisJson(*diagnosis));
  std::cout << (arguments.json ? DiagnosisJson(*diagnosis) : DiagnosisText(*diagnosis));
  return kDone;
}

}  // namespace calib::ctl
