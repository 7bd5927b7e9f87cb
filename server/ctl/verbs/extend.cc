#include <algorithm>
#include <iostream>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "dem/registry/declared_effects.h"
#include "server/client/interrupt.h"
#include "server/client/laboratory.h"
#include "server/ctl/answer_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"
#include "server/diagnosis/extension.h"
#include "server/diagnosis/race_list.h"
#include "server/report/documents/json_documents.h"
#include "server/report/text/people_units.h"
#include "server/report/views/warnings.h"

namespace calib::ctl {

namespace {

struct ExtendOptions {
  std::string campaign;
  std::vector<std::string> effects{};
};

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

void Declare(OptionList& list, ExtendOptions& options) {
  list.Campaign(options.campaign);
  list.Texts("--effect", options.effects, "name, as shown by `calibctl effects`").Required();
}

absl::StatusOr<int> Extend(const CommonOptions& common, const ExtendOptions& options) {
  client::CatchInterrupts();
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  client::Laboratory laboratory(*session, common.server);
  ASSIGN_OR_RETURN(const auto parent, laboratory.Finished(options.campaign));
  for (const std::string& name : options.effects) {
    const dem::EffectInfo* effect = dem::FindEffect(parent.campaign.model.user_effects, name);
    const std::string why =
        effect == nullptr ? "" : diagnosis::WhyNotShown(parent.campaign, *effect);
    if (!why.empty()) {
      return absl::InvalidArgumentError(absl::StrCat(
          name, " cannot be calibrated with the tests of ", options.campaign, ": ", why));
    }
  }
  ASSIGN_OR_RETURN(const auto text, diagnosis::ExtensionText(parent, {.effects = options.effects,
                                                                      .purpose = "extension",
                                                                      .samples = std::nullopt,
                                                                      .iterations = std::nullopt}));
  ASSIGN_OR_RETURN(const auto view,
                   laboratory.Run(parent, text, "extension of " + options.campaign));
  if (common.json) {
    std::cout << report::PosteriorJson(
        view.posterior, view.campaign.parameters,
        report::ShapeOf(view.posterior, view.campaign.parameters, view.samples));
    return kDone;
  }
  std::cout << view.campaign.name << ": campaign " << view.status.campaign() << "\n"
            << NewPriors(parent, view) << "\n"
            << PosteriorText(view.posterior, report::Warnings(view)) << "\n"
            << ComparisonText(report::Compare(view, report::PredictReadings(view)));
  return kDone;
}

}  // namespace

Verb ExtendVerb() {
  return MakeVerb<ExtendOptions>(
      {.name = "extend",
       .description = "A new campaign: this one joined by effects, started from its posterior",
       .example = "extend c1 --effect rolling_resistance --state calib-state"},
      &Declare, &Extend);
}

}  // namespace calib::ctl
