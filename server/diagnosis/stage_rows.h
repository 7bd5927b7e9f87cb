#pragma once
// The points that each stage of a design asks for, and their rows. Pure.

#include <Eigen/Core>
#include <vector>

#include "server/diagnosis/design_caps.h"
#include "server/diagnosis/knowledge.h"
#include "server/diagnosis/verification.h"

namespace calib::diagnosis {

/// K, SI: strengths of 1 in a scout, which lie between the two steps of the catalogue.
Eigen::VectorXd UnitsOfCatalogue(const Race& race);

/// DesignCaps::scout_runs points of each of these entries at the centre of the region, by turns;
/// strengths times `part`.
inference::DesignPoints ScoutPoints(const DesignRows& rows, const BaseRegion& region,
                                    const std::vector<int>& entries, double part);

/// A run of the base again with each numerical choice, on its stream.
std::vector<campaign::RunOf> NumericsRows(const DesignRows& rows, const KnownBefore& before);

/// Points of all entries for the main stage, of what a scout knows; calculated ones are off.
inference::DesignPoints MainPoints(const KnownBefore& before, const Knowledge& known);

/// Posterior draws of the leading models, of the kept entries: of each the same number, evenly
/// spread over its draws. Precondition: some model has draws.
inference::DesignPoints SequentialCandidates(const Asked& asked);

/// DesignCaps::verification_runs at the optimum of each model, of the kept entries. in: at least
/// one model
inference::DesignPoints VerificationPoints(const std::vector<VerifiedModel>& models);

/// The rows of points on streams from `first_stream` on. What the design cannot run is changed
/// until it can: the last effect of those that do not go together is left out, and base parameters
/// that do not meet the campaign's constraints give way to a draw of the region.
std::vector<campaign::RunOf> AdmissibleRows(const campaign::Campaign& design,
                                            const DesignRows& rows, const BaseRegion& region,
                                            inference::DesignPoints points, int first_stream);

}  // namespace calib::diagnosis
