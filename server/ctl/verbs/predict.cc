#include <iostream>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/client/interrupt.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/prediction.h"
#include "server/ctl/verb.h"

namespace calib::ctl {
namespace {

struct PredictOptions {
  std::string campaign;
  std::string test;                   ///< YAML file with the tests to predict
  std::vector<std::string> exceed{};  ///< OBSERVABLE=LEVEL
  int draws = 20;                     ///< runs from the posterior
};

void Declare(OptionList& list, PredictOptions& options) {
  list.Campaign(options.campaign);
  list.Text("--test", options.test,
            "YAML: one experiment, or a file with experiments, as in a campaign file")
      .Required();
  list.Texts("--exceed", options.exceed,
             "OBSERVABLE=LEVEL with an optional unit: probability to exceed it");
  list.BoundedNumber("--draws", options.draws, {2, 400}, "runs from the posterior [20]");
}

absl::StatusOr<int> Predict(const CommonOptions& common, const PredictOptions& options) {
  client::CatchInterrupts();
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  client::Laboratory laboratory(*session, common.server);
  ASSIGN_OR_RETURN(const auto view, laboratory.Finished(options.campaign));
  if (view.campaign.precomputed) {  // before its tests are held against a model
    return absl::FailedPreconditionError(
        absl::StrCat("the runs of ", options.campaign,
                     " were made elsewhere: there is no model to run another test with"));
  }
  ASSIGN_OR_RETURN(const auto tests, ReadTests(session->client(), options.test, view));
  ASSIGN_OR_RETURN(
      const auto prediction,
      Predict(laboratory, view, tests, {.draws = options.draws, .exceed = options.exceed}));
  std::cout << (common.json ? PredictionJson(prediction) : PredictionText(prediction));
  return kDone;
}

}  // namespace

Verb PredictVerb() {
  return MakeVerb<PredictOptions>(
      {.name = "predict",
       .description = "The posterior propagated to another test: mean, band, exceedance",
       .example = "predict c1 --test other.yaml --state calib-state"},
      &Declare, &Predict);
}

}  // namespace calib::ctl
