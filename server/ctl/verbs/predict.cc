#include <iostream>

#include "absl/strings/str_cat.h"
#include "server/client/interrupt.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/prediction.h"
#include "server/ctl/verbs.h"

namespace calib::ctl {

int Predict(const Arguments& arguments) {
  client::CatchInterrupts();
  const auto session = client::Session::Open(arguments.server);
  if (!session.ok()) return Fail(session.status());
  client::Laboratory laboratory(**session, arguments.server);
  const auto view = laboratory.Finished(arguments.campaign);
  if (!view.ok()) return Fail(view.status());
  if (view->campaign.precomputed) {  // before its tests are held against a model
    return Fail(absl::FailedPreconditionError(
        absl::StrCat("the runs of ", arguments.campaign,
                     " were made elsewhere: there is no model to run another test with")));
  }
  const auto tests = ReadTests((*session)->client(), arguments.test, *view);
  if (!tests.ok()) return Fail(tests.status());
  const auto prediction =
      Predict(laboratory, *view, *tests, {.draws = arguments.draws, .exceed = arguments.exceed});
  if (!prediction.ok()) return Fail(prediction.status());
  std::cout << (arguments.json ? PredictionJson(*prediction) : PredictionText(*prediction));
  return kDone;
}

}  // namespace calib::ctl
