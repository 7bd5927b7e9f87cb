#pragma once
// A run of a campaign -> what a worker is told: an AttemptSpec of this tree's DEM or a ProgramRun
// of the user's program; and the digest by which equal evaluations are recognised.

#include <string>

#include "calib/v1/worker.pb.h"
#include "dem/model/scenario.h"
#include "server/campaign/model/campaign.h"

namespace calib::messages {

/// The message for a scenario whose specimen is named by `specimen` (the scenario's own packing is
/// not sent, nor its meshes, which SpecOf() names).
v1::AttemptSpec ToSpec(const dem::Scenario& scenario, const campaign::Specimen& specimen,
                       const std::string& experiment);

/// The spec of one evaluation by the DEM.
v1::AttemptSpec SpecOf(const campaign::Campaign& campaign, int experiment,
                       const campaign::RunOf& run);

/// The same by the campaign's program.
v1::ProgramRun ProgramRunOf(const campaign::Campaign& campaign, int experiment,
                            const campaign::RunOf& run);

/// One evaluation as a lease has it, by whichever of them; without an attempt.
v1::Lease LeaseOf(const campaign::Campaign& campaign, int experiment, const campaign::RunOf& run);

/// What a worker has for a run.
struct RunShare {
  int threads = 1;    ///< > 0
  double memory = 0;  ///< [bytes]; 0: nobody knows
};
/// Sets the threads and limits of a lease: what the campaign says, else what the worker has.
void SetResources(const campaign::Campaign& campaign, const RunShare& share, v1::Lease& lease);

/// SHA-256 of everything that determines the states: of a spec all but its name and thread count,
/// and the version of the mechanics; of a program's run all but threads, limits and what is kept of
/// it.
std::string SpecDigest(v1::AttemptSpec spec);
std::string RunDigest(v1::Lease run);

}  // namespace calib::messages
