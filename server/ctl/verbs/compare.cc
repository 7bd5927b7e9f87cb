#include <iostream>
#include <string>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/client/documents.h"
#include "server/client/progress.h"
#include "server/client/session.h"
#include "server/ctl/answer_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/next_step.h"
#include "server/ctl/option_list.h"
#include "server/ctl/terminal.h"
#include "server/ctl/verb.h"
#include "server/report/documents/fit_plots.h"
#include "server/report/documents/json_documents.h"

namespace calib::ctl {
namespace {

constexpr int kPlots = 6;  // more scroll out of sight

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
  const auto ask = [&] {
    const client::BusyLine busy("comparing " + options.campaign + " with its measurements");
    return client::CompareInFull(session->client(), options.campaign);
  };
  ASSIGN_OR_RETURN(const auto compared, ask());
  if (common.json) {
    std::cout << report::ComparisonJson(options.campaign, compared.comparison, compared.curves);
    return kDone;
  }
  const report::Comparison& comparison = compared.comparison;
  if (!compared.is_known) return absl::FailedPreconditionError(comparison.note);
  std::cout << ComparisonText(comparison) +
                   report::FitPlots(compared.curves, kPlots, ThisTerminal()) +
                   Next(common, options, comparison);
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
