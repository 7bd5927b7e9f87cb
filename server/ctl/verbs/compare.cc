#include <iostream>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "server/client/load_view.h"
#include "server/client/session.h"
#include "server/ctl/answer_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/next_step.h"
#include "server/ctl/verbs.h"
#include "server/report/documents/json_documents.h"
#include "server/report/views/discrepancies.h"
#include "server/report/views/parameter_drift.h"
#include "server/report/views/warnings.h"

namespace calib::ctl {
namespace {

std::string Next(const Arguments& arguments, const report::Comparison& comparison) {
  constexpr double kMisses = 0.01;  // p, as of the adequacy test of diagnose
  if (!comparison.p_value) return "";
  if (*comparison.p_value < kMisses) {
    return NextStep(CommandOf(arguments, "diagnose " + arguments.campaign),
                    "which physical effect is missing");
  }
  return NextStep(CommandOf(arguments, absl::StrCat("report ", arguments.campaign, " -o ",
                                                    arguments.campaign, ".html")),
                  "parameters, curves and misfit in one file");
}

}  // namespace

int Compare(const Arguments& arguments) {
  const auto session = client::Session::Open(arguments.server);
  if (!session.ok()) return Fail(session.status());
  const auto view = client::LoadView((*session)->client(), arguments.campaign);
  if (!view.ok()) return Fail(view.status());
  if (view->iterations.empty()) {
    return Fail(absl::FailedPreconditionError("no iteration of " + arguments.campaign +
                                              " is complete yet: nothing to compare"));
  }
  const auto predictions = report::PredictReadings(*view);
  report::Comparison comparison = report::Compare(*view, predictions);
  report::AddDiscrepancies(*view, predictions, comparison);
  comparison.prior_conflicts = report::PriorConflicts(*view);
  // Parameters at a bound are among where it fails.
  std::vector<std::string> of_posterior = report::PosteriorWarnings(*view);
  comparison.warnings.insert(comparison.warnings.begin(), of_posterior.begin(), of_posterior.end());
  if (auto drifts = report::ParameterDrifts(*view); drifts.ok()) {
    comparison.parameter_drift = *std::move(drifts);
  } else {
    comparison.note += (comparison.note.empty() ? "" : " ") +
                       ("Drift of the parameters: " + std::string(drifts.status().message()) + ".");
  }
  std::cout << (arguments.json ? report::ComparisonJson(arguments.campaign, comparison)
                               : ComparisonText(comparison) + Next(arguments, comparison));
  return kDone;
}

}  // namespace calib::ctl
