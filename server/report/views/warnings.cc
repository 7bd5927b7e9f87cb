#include "server/report/views/warnings.h"

#include <fmt/format.h>

#include <algorithm>

#include "server/messages/read_words.h"
#include "server/report/text/people_units.h"

namespace calib::report {

std::vector<std::string> PosteriorWarnings(const CampaignView& view) {
  const v1::Posterior& posterior = view.posterior;
  std::vector<std::string> warnings(posterior.warnings().begin(), posterior.warnings().end());
  if (posterior.parameters_size() > 0 && !posterior.converged() &&
      messages::SourceOf(posterior) != campaign::PosteriorSource::kNone &&
      messages::StateOf(view.status) == campaign::CampaignState::kFinished) {
    warnings.emplace_back(
        "The iterations ended before the posterior means settled: treat the intervals as "
        "provisional, or go on with more "
        "iterations or samples.");
  }
  return warnings;
}

namespace {

bool IsSpread(const campaign::Campaign& campaign, const std::string& name) {
  return std::any_of(campaign.populations.begin(), campaign.populations.end(),
                     [&](const campaign::Population& population) {
                       return campaign.parameters[population.spread].name == name;
                     });
}

}  // namespace

std::vector<std::string> Warnings(const CampaignView& view) {
  std::vector<std::string> warnings = PosteriorWarnings(view);
  for (const auto& parameter : view.posterior.parameters()) {
    if (!parameter.at_bound()) continue;
    if (IsSpread(view.campaign, parameter.name())) {  // its prior has one bound, 0
      warnings.push_back(fmt::format("{} lies at 0: the values of the labels do not differ.",
                                     NameForPeople(parameter.name())));
      continue;
    }
    warnings.push_back(
        fmt::format("{} presses against a bound of its prior: widen the prior if it was a guess, "
                    "or look for a missing effect.",
                    NameForPeople(parameter.name())));
  }
  return warnings;
}

}  // namespace calib::report
