#include "server/planning/phases/audit.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "server/planning/rungs.h"

namespace calib::planning {
namespace {

/// Bound on the posterior mass that a campaign may leave out.
double MayLeaveOut(const Step& step) {
  return step.campaign().early_stopping.value_or(campaign::EarlyStopping{}).discard_at_most;
}

}  // namespace

std::optional<LeftOut> LookAtStopped(Step& step) {
  const Definition& definition = step.definition;
  const History& history = step.history;
  Plan& plan = step.plan;
  if (const auto scouts = Scouts(definition, history); !scouts.empty()) {
    for (const store::EvaluationKey& key : scouts) {
      plan.resumed.push_back({.key = key, .rest_after = std::nullopt});
    }
    plan.log.push_back(absl::StrCat(
        scouts.size(), " evaluations go on to their ends: those that fit best up to the rung"));
    return std::nullopt;
  }
  const auto loss = StatedLoss(definition, history);
  if (!loss.ok()) {
    (void)step.Fail(loss.status());
    return std::nullopt;
  }
  if (!loss->resume.empty()) {
    for (const store::EvaluationKey& key : loss->resume) {
      plan.resumed.push_back({.key = key, .rest_after = NextRung(definition, history, key)});
    }
    plan.log.push_back(absl::StrCat(loss->resume.size(),
                                    RestsAtRungs(definition)
                                        ? " resting or stopped evaluations go on"
                                        : " evaluations stopped early are resumed",
                                    ": with the weights as they are now they could matter"));
    return std::nullopt;
  }
  if (const auto chosen = ToAudit(definition, history, *loss); !chosen.empty()) {
    for (const int sample : chosen) {
      plan.audited.emplace_back(sample, loss->bounds.at(sample));
    }
    for (const store::EvaluationKey& key : history.stopped_keys) {
      if (std::binary_search(chosen.begin(), chosen.end(), key.sample)) {
        plan.resumed.push_back({.key = key, .rest_after = std::nullopt});
      }
    }
    plan.log.push_back(absl::StrCat(
        chosen.size(), " samples stopped early go on to their ends to see what stopping loses"));
    return std::nullopt;
  }
  const auto audit = AuditOf(step.stated, history);
  if (!audit.ok()) {
    (void)step.Fail(audit.status());
    return std::nullopt;
  }
  return LeftOut{.stated = loss->stated, .audit = *audit};
}

double UnknownMassNow(const Step& step) {
  if (step.history.unknown.empty()) return 0;
  if (!step.campaign().method->weighs_samples()) return store::kUnknown;
  const auto mass = UnknownMass(step.definition, step.history);
  return mass.ok() ? *mass : store::kUnknown;
}

bool UnknownIsSmall(const Step& step) {
  return step.history.unknown.empty() || UnknownMassNow(step) <= MayLeaveOut(step);
}

void TellUnknown(const Step& step, v1::Posterior& posterior) {
  if (step.history.unknown.empty()) return;
  const double mass = UnknownMassNow(step);
  posterior.set_unknown(static_cast<int>(step.history.unknown.size()));
  posterior.set_unknown_mass(mass);
  const std::string held = std::isnan(mass)
                               ? "what they could hold of the posterior is not known: not converged"
                               : absl::StrCat(
                                     "were they as likely as the best that finished, they would "
                                     "hold ",
                                     mass, " of the posterior mass");
  const std::string verdict =
      std::isnan(mass) || mass <= MayLeaveOut(step)
          ? "."
          : absl::StrCat(", more than the ", MayLeaveOut(step),
                         " that may be left out (early_stopping.discard_at_most): not converged. "
                         "`calibctl samples` says what their program printed last.");
  posterior.add_warnings(absl::StrCat(step.history.unknown.size(), " of ",
                                      step.history.samples.size(),
                                      " samples are unknown, for the program failed on them as "
                                      "often as it may, and are set aside; ",
                                      held, verdict));
}

}  // namespace calib::planning
