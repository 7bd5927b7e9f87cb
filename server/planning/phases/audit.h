#pragma once
// What runs that ended early, or not at all, leave out of a posterior of weighted samples.

#include <optional>

#include "absl/status/status.h"
#include "server/planning/early_stopping.h"
#include "server/planning/phases/step.h"

namespace calib::planning {

/// What a conclusion says of it.
struct LeftOut {
  double stated = 0;  ///< share of the posterior mass at most
  Audit audit{};      ///< of samples that went on to their ends to be looked at
};

/// Before a conclusion: sends on what could still matter, or is to be looked at; empty: something
/// was sent on, or the campaign has failed, and the plan says so.
std::optional<LeftOut> LookAtStopped(Step& step);

/// Mass that unknown samples could hold, relative to the finished mass; NaN: nobody can tell.
double UnknownMassNow(const Step& step);
/// Whether that is as little as may be left out.
bool UnknownIsSmall(const Step& step);
void TellUnknown(const Step& step, v1::Posterior& posterior);

}  // namespace calib::planning
