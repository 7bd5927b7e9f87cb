#include <fmt/format.h>

#include <cstdint>
#include <iostream>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "server/client/interrupt.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/next_step.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"
#include "server/diagnosis/diagnosis_support.h"
#include "server/diagnosis/improvement.h"
#include "server/report/text/people_units.h"
#include "server/report/text/text_table.h"

namespace calib::ctl {
namespace {

struct ImproveOptions {
  std::string campaign;
  int max_effects = 3;
  std::optional<std::int64_t> max_evaluations{};
  std::vector<std::string> without{};  ///< effects that are not to be thought of
};

std::string Probable(const std::optional<double>& probability) {
  constexpr double kLeast = 1e-3;  // below it only how small
  if (!probability) return "–";
  return *probability < kLeast ? "< 0.1 %" : report::Percent(*probability, 2);
}

std::string ToText(const diagnosis::Improvement& improvement) {
  const std::vector<diagnosis::ImproveStep>& steps = improvement.steps();
  const auto number = [](const std::optional<double>& error) {
    return error ? report::Number(*error, 3) : "–";
  };
  report::TextTable table(
      {"<campaign", "<effects", "probable", "error", "held out", "log evidence", "<verdict"});
  for (const diagnosis::ImproveStep& step : steps) {
    table.AddRow({step.campaign, step.effects.empty() ? "none" : absl::StrJoin(step.effects, " + "),
                  Probable(step.probability), report::Number(step.rms_error, 3),
                  number(step.heldout_rms_error), report::Number(step.log_evidence, 5),
                  step.verdict});
  }
  std::string text = table.ToString() + "\n";
  text +=
      "Probable: when it was asked for last. Errors in sd, of the fitted data and of held-out "
      "data.\n\n";
  for (const diagnosis::ImproveStep& step : steps) {
    text += report::Wrapped(fmt::format("{}: {}", step.campaign, step.reason), "", "  ");
  }
  if (steps.size() > 1) {
    text += fmt::format("Error {} before, {} after", report::Number(steps.front().rms_error, 3),
                        report::Number(steps.back().rms_error, 3));
    if (steps.front().heldout_rms_error && steps.back().heldout_rms_error) {
      text += fmt::format("; on held-out data {} before, {} after",
                          report::Number(*steps.front().heldout_rms_error, 3),
                          report::Number(*steps.back().heldout_rms_error, 3));
    }
    text += ".\n";
  }
  if (const std::size_t before = improvement.opened_before().size(); before > 0) {
    text += report::Wrapped(
        fmt::format("The held-out data were opened before, for {} of this campaign: who asks again "
                    "has seen them, and they judge no longer as if they were new.",
                    before == 1 ? "another verdict" : fmt::format("{} other verdicts", before)),
        "! ", "  ");
  }
  return text + fmt::format("{} model evaluations.\n", improvement.evaluations());
}

std::string Next(const CommonOptions& common, const diagnosis::ImproveStep& last) {
  if (last.verdict == "adequate") {
    return NextStep(CommandOf(common.server, fmt::format("report {0} -o {0}.html", last.campaign)),
                    "parameters, curves and what was tried on the way, in one file");
  }
  return NextStep(CommandOf(common.server, "diagnose " + last.campaign),
                  "what was tried on it, and the experiment that would tell more");
}

void Declare(OptionList& list, ImproveOptions& options) {
  list.Campaign(options.campaign);
  list.BoundedNumber("--max-effects", options.max_effects, {1, 10},
                     "at most so many are added [3]");
  list.BoundedNumber(
      "--max-evaluations", options.max_evaluations, {1, 1'000'000'000},
      "model evaluations of all designs and calibrations, those that diagnose "
      "has made already included; held-out tests of a calibration count and may exceed it");
  list.Texts("--without", options.without, "effect that is not to be thought of");
}

absl::StatusOr<int> Improve(const CommonOptions& common, const ImproveOptions& options) {
  client::CatchInterrupts();
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  client::Laboratory laboratory(*session, common.server);
  ASSIGN_OR_RETURN(auto view, laboratory.Finished(options.campaign));
  RETURN_IF_ERROR(diagnosis::CheckLeftOut(options.without, view.campaign));
  diagnosis::Improvement improvement(laboratory, session->client(),
                                     {.effects = options.max_effects,
                                      .evaluations = options.max_evaluations,
                                      .without = options.without});
  RETURN_IF_ERROR(improvement.From(std::move(view)));
  std::cout << (common.json ? improvement.Json()
                            : ToText(improvement) + Next(common, improvement.steps().back()));
  return kDone;
}

}  // namespace

Verb ImproveVerb() {
  return MakeVerb<ImproveOptions>(
      {.name = "improve",
       .description = "Compare, diagnose, extend until the misfit is explained or nothing helps",
       .example = "improve c1 --state calib-state",
       .speaks_of_errors = true},
      &Declare, &Improve);
}

}  // namespace calib::ctl
