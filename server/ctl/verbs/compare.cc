#include <iostream>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/client/load_view.h"
#include "server/client/session.h"
#include "server/ctl/answer_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/next_step.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"
#include "server/messages/read_words.h"
#include "server/report/documents/json_documents.h"
#include "server/report/views/discrepancies.h"
#include "server/report/views/parameter_drift.h"
#include "server/report/views/warnings.h"

namespace calib::ctl {
namespace {

struct CompareOptions {
  std::string campaign;
};

std::string Next(const CommonOptions& common, const CompareOptions& options,
                 const report::Comparison& comparison) {
  constexpr double kMisses = 0.01;  // p, as of the adequacy test of diagnose
  if (!comparison.p_value) return "";
  if (*comparison.p_value < kMisses) {
    return NextStep(CommandOf(common.server, "diagnose " + options.campaign),
                    "which physical effect is missing");
  }
  return NextStep(CommandOf(common.server, absl::StrCat("report ", options.campaign, " -o ",
                                                        options.campaign, ".html")),
                  "parameters, curves and misfit in one file");
}

void Declare(OptionList& list, CompareOptions& options) { list.Campaign(options.campaign); }

absl::StatusOr<int> Compare(const CommonOptions& common, const CompareOptions& options) {
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  ASSIGN_OR_RETURN(const auto view, client::LoadView(session->client(), options.campaign));
  if (messages::RunsRowsOnly(view.status)) {
    return absl::FailedPreconditionError(
        messages::InfersNothing(options.campaign, *messages::MethodOf(view.status)));
  }
  if (view.iterations.empty()) {
    return absl::FailedPreconditionError("no iteration of " + options.campaign +
                                         " is complete yet: nothing to compare");
  }
  const auto predictions = report::PredictReadings(view);
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
  std::cout << (common.json ? report::ComparisonJson(options.campaign, comparison)
                            : ComparisonText(comparison) + Next(common, options, comparison));
  return kDone;
}

}  // namespace

Verb CompareVerb() {
  return MakeVerb<CompareOptions>(
      {.name = "compare",
       .description = "Model against measurements: where it fits and where it fails",
       .example = "compare c1 --state calib-state",
       .speaks_of_errors = true},
      &Declare, &Compare);
}

}  // namespace calib::ctl
