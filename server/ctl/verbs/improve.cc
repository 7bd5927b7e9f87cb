#include <fmt/format.h>

#include <iostream>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_join.h"
#include "server/client/interrupt.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/next_step.h"
#include "server/ctl/verbs.h"
#include "server/diagnosis/diagnosis_support.h"
#include "server/diagnosis/improvement.h"
#include "server/report/text/people_units.h"
#include "server/report/text/text_table.h"

namespace calib::ctl {
namespace {

std::string ToText(const diagnosis::Improvement& improvement) {
  const std::vector<diagnosis::ImproveStep>& steps = improvement.steps();
  const auto number = [](const std::optional<double>& error) {
    return error ? report::Number(*error, 3) : "–";
  };
  report::TextTable table(
      {"<campaign", "<effects", "error", "left out", "held out", "log evidence", "<verdict"});
  for (const diagnosis::ImproveStep& step : steps) {
    table.AddRow({step.campaign, step.effects.empty() ? "none" : absl::StrJoin(step.effects, " + "),
                  report::Number(step.rms_error, 3), number(step.left_out_error),
                  number(step.heldout_rms_error), report::Number(step.log_evidence, 5),
                  step.verdict});
  }
  std::string text = table.ToString() + "\n";
  text +=
      "Errors in sd: of the fitted data; of each part of them, fitted to the others; of held-out "
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

std::string Next(const Arguments& arguments, const diagnosis::ImproveStep& last) {
  if (last.verdict == "adequate") {
    return NextStep(CommandOf(arguments, fmt::format("report {0} -o {0}.html", last.campaign)),
                    "parameters, curves and what was tried on the way, in one file");
  }
  return NextStep(CommandOf(arguments, "diagnose " + last.campaign),
                  "what was tried on it, and the experiment that would tell more");
}

}  // namespace

int Improve(const Arguments& arguments) {
  client::CatchInterrupts();
  const auto session = client::Session::Open(arguments.server);
  if (!session.ok()) return Fail(session.status());
  client::Laboratory laboratory(**session, arguments.server);
  auto view = laboratory.Finished(arguments.campaign);
  if (!view.ok()) return Fail(view.status());
  if (auto status = diagnosis::CheckLeftOut(arguments.effects, view->campaign); !status.ok()) {
    return Fail(status);
  }
  diagnosis::Improvement improvement(laboratory, (*session)->client(),
                                     {.effects = arguments.max_effects,
                                      .evaluations = arguments.max_evaluations,
                                      .without = arguments.effects});
  if (auto status = improvement.From(*std::move(view)); !status.ok()) return Fail(status);
  std::cout << (arguments.json ? improvement.Json()
                               : ToText(improvement) + Next(arguments, improvement.steps().back()));
  return kDone;
}

}  // namespace calib::ctl
