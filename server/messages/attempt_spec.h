#pragma once
// dem::Scenario -> AttemptSpec: what a worker is told, and the digest by which equal evaluations
// are recognised.

#include <string>

#include "calib/v1/worker.pb.h"
#include "dem/model/scenario.h"
#include "server/campaign/model/campaign.h"

namespace calib::messages {

/// The message for a scenario whose specimen is named by `specimen` (the scenario's own packing is
/// not sent, nor its meshes, which SpecOf() names).
v1::AttemptSpec ToSpec(const dem::Scenario& scenario, const campaign::Specimen& specimen,
                       const std::string& experiment);

/// The spec of one evaluation.
v1::AttemptSpec SpecOf(const campaign::Campaign& campaign, int experiment,
                       const campaign::RunOf& run);

/// SHA-256 of everything that determines the states: the spec without its name and thread count,
/// and the version of the mechanics.
std::string SpecDigest(v1::AttemptSpec spec);

}  // namespace calib::messages
