#pragma once
// What the sizes of its grains make of an experiment, before any specimen is made.

#include <string>
#include <vector>

#include "dem/registry/scenario_problems.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// The scenario of an experiment at the middle of the priors, of the race of a design these effects
/// in it.
dem::Scenario MiddleScenario(const Campaign& campaign, const Experiment& experiment,
                             const std::vector<std::string>& with = {});

/// What is said of one specimen's grains.
struct SpecimenRemarks {
  std::string path{};  ///< of its packing file; empty: it has a recipe
  int grains = 0;
  dem::GrainRemarks remarks{};
};

/// Of the experiment's first specimen by a recipe, whose realizations differ in places alone or by
/// the draw of their sizes, and of each of its packing files. Empty for tests without a packing.
/// Precondition: dem::ScenarioProblems() finds nothing wrong with the scenario. Pure.
std::vector<SpecimenRemarks> GrainRemarksOf(const Experiment& experiment,
                                            const dem::Scenario& scenario);

}  // namespace calib::campaign
