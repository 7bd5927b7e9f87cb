#pragma once
// Runs with effects that a campaign's own tables hold (campaign::RunsWithEffects), as a batch of a
// design. Pure.

#include "server/diagnosis/design_rows.h"
#include "server/diagnosis/run_maker.h"

namespace calib::diagnosis {

/// Those of the rows whose effects all take part in the race; a run that has another one is none of
/// its models. first_stream: of the first; each is another specimen. Entries that no table holds
/// are at their null. Of stage `main`; no runs where the campaign holds none.
EndedBatch HeldRuns(const campaign::Campaign& campaign, const DesignRows& rows, int first_stream);

}  // namespace calib::diagnosis
