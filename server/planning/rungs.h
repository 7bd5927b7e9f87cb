#pragma once
// Breadth-first scheduling: all samples come to a rung and rest there, those that can still count
// go on to the next. What goes on follows from the store alone once every evaluation has ended or
// rests, so that the same samples are run the same way whatever arrived first.
//
// A bound on a weight says something only beside finished mass. While too few samples have finished
// (the first iteration), those that can still become best go on from the first rung to their ends:
// scouts. Then, rung by rung, StatedLoss (early_stopping.h) says which of the others have to go on.

#include <optional>
#include <vector>

#include "server/planning/definition.h"
#include "server/planning/history.h"

namespace calib::planning {

/// Whether the samples of a campaign rest at rungs: it asks for it and may stop samples at all.
bool RestsAtRungs(const Definition& definition);

/// The load step of the experiment behind which a new evaluation rests; empty: it runs to its end.
/// A share s of n load steps is the ceil(s n)-th.
std::optional<int> FirstRung(const Definition& definition, int experiment);

/// Where a stopped evaluation rests next when it goes on: the rung beyond the one to which it was
/// sent; empty: its end.
std::optional<int> NextRung(const Definition& definition, const History& history,
                            const store::EvaluationKey& key);

/// Evaluations to be run to their ends before the others can be judged, in order: of the samples
/// with the largest importance times best possible likelihood (ties: the earlier sample) so many
/// that twice as many finish as the guiding weights leave effective. Empty: enough have finished,
/// nothing rests, or the campaign has no rungs.
std::vector<store::EvaluationKey> Scouts(const Definition& definition, const History& history);

}  // namespace calib::planning
