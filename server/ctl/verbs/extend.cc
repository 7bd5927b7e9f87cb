#include <algorithm>
#include <iostream>

#include "absl/strings/str_cat.h"
#include "server/client/interrupt.h"
#include "server/client/laboratory.h"
#include "server/ctl/answer_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/verbs.h"
#include "server/diagnosis/extension.h"
#include "server/diagnosis/screen_shares.h"
#include "server/report/documents/json_documents.h"
#include "server/report/text/people_units.h"
#include "server/report/views/warnings.h"

namespace calib::ctl {

namespace {

// Many default priors are multiples of a scale that depends on the parent's stiffness.
std::string NewPriors(const report::CampaignView& parent, const report::CampaignView& view) {
  std::string text;
  for (const v1::Posterior::Parameter& p : view.posterior.parameters()) {
    const auto& old = parent.campaign.parameters;
    if (std::any_of(old.begin(), old.end(), [&p](const auto& o) { return o.name == p.name(); })) {
      continue;
    }
    const auto shown = [&p](double value) {
      return report::NumberWithUnit(value, p.name(), p.unit(), 3);
    };
    absl::StrAppend(&text, "Prior of ", p.name(), ": ", shown(p.prior_min()), " to ",
                    shown(p.prior_max()), ", the default for the model of ",
                    parent.status.campaign(), "; a campaign file can give another.\n");
  }
  return text;
}

}  // namespace

int Extend(const Arguments& arguments) {
  client::CatchInterrupts();
  const auto session = client::Session::Open(arguments.server);
  if (!session.ok()) return Fail(session.status());
  client::Laboratory laboratory(**session, arguments.server);
  const auto parent = laboratory.Finished(arguments.campaign);
  if (!parent.ok()) return Fail(parent.status());
  for (const std::string& name : arguments.effects) {
    const dem::EffectInfo* effect = dem::FindEffect(parent->campaign.model.user_effects, name);
    const std::string why =
        effect == nullptr ? "" : diagnosis::WhyNotShown(parent->campaign, *effect);
    if (!why.empty()) {
      return Fail(absl::InvalidArgumentError(absl::StrCat(
          name, " cannot be calibrated with the tests of ", arguments.campaign, ": ", why)));
    }
  }
  const auto text = diagnosis::ExtensionText(*parent, {.effects = arguments.effects,
                                                       .purpose = "extension",
                                                       .samples = std::nullopt,
                                                       .iterations = std::nullopt});
  if (!text.ok()) return Fail(text.status());
  const auto view = laboratory.Run(*parent, *text, "extension of " + arguments.campaign);
  if (!view.ok()) return Fail(view.status());
  if (arguments.json) {
    std::cout << report::PosteriorJson(view->posterior, view->campaign.parameters);
    return kDone;
  }
  std::cout << view->campaign.name << ": campaign " << view->status.campaign() << "\n"
            << NewPriors(*parent, *view) << "\n"
            << PosteriorText(view->posterior, report::Warnings(*view)) << "\n"
            << ComparisonText(report::Compare(*view, report::PredictReadings(*view)));
  return kDone;
}

}  // namespace calib::ctl
