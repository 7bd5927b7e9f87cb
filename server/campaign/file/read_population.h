#pragma once
// Parameters with `per`: which labels have a value of their own, and the calibrated parameters that
// this makes (model/population.h).

#include <optional>
#include <string>
#include <vector>

#include "server/campaign/file/parameters/experiment_numbers.h"
#include "server/campaign/file/shared/map_reader.h"
#include "server/campaign/file/shared/read_prior.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// Labels of the experiments in their order, each once. setting: of a parameter that is one, which
/// not all experiments have.
std::vector<std::string> LabelsOf(Per per, const std::optional<SettingOf>& setting,
                                  const std::vector<ExperimentOutline>& outlines);

/// Gives the last of campaign.parameters, which is the common value, its spread and scores, where
/// `beside` says so. Problems, each one sentence: a number of one experiment, a parameter of what
/// runs of a design may lack, an experiment without a batch, names that would mean two things.
void AddPopulation(const BesidePrior& beside, const std::vector<ExperimentOutline>& outlines,
                   MapReader& parameters, Campaign& campaign);

/// Writes the labels that the parameters of a file have into it, so that they stay when its
/// experiments are changed. Nothing is changed where they stand there.
void StateLabels(YamlNode& file);
/// Adds the labels of the file's experiments to those that stand there; what has no batch where one
/// is needed gets one that no other has.
void AddLabels(YamlNode& file);

}  // namespace calib::campaign
