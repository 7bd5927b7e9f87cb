#pragma once
// When a campaign decides: when everything asked for has ended, or while runs are under way. Pure.
// What is decided is in the store before it has any effect, so that a server that was killed goes
// on from there.

#include "server/planning/definition.h"

namespace calib::planning {

/// Whether plans are made while runs are under way: points that are chosen one by one, and
/// everything that is decided at once.
bool DecidesWhileRunning(const Definition& definition);

/// Whether runs are stopped, or points chosen, by what has arrived at that moment: another run of
/// the same campaign may decide otherwise.
bool DecidesAtOnce(const Definition& definition);

/// Whether every run goes to its end, whatever has arrived first: one that another campaign makes
/// may then take the place of one of these at any time.
bool RunsToItsEnds(const Definition& definition);

}  // namespace calib::planning
