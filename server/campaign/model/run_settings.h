#pragma once
// Settings of experiments that are calibrated or tied: what a run's values make of its scenario and
// of the recipe of its specimen. Pure.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// Gives one number of an experiment (file/parameters/experiment_numbers.h names them) to a
/// scenario that has everything else. What belongs to the recipe of the specimen is left alone.
void SetNumber(const std::string& number, double value, const Experiment& experiment,
               dem::Scenario& scenario);

/// Gives a number `packing.X` to a recipe; any other is left alone.
void SetNumber(const std::string& number, double value, dem::PackingRecipe& recipe);

/// Whether the number belongs to the recipe of the specimen.
bool IsOfRecipe(const std::string& number);

/// Applies what the values say of this experiment's settings to its scenario. values: in the order
/// of Campaign::parameters.
void ChangeSettings(const Campaign& campaign, const Experiment& experiment,
                    std::span<const double> values, dem::Scenario& scenario);

/// The recipe of the specimen that a run takes, where its values change it; empty: the specimen is
/// as Experiment::specimens has it.
std::optional<dem::PackingRecipe> ChangedRecipe(const Campaign& campaign,
                                                const Experiment& experiment, const RunOf& run);

}  // namespace calib::campaign
