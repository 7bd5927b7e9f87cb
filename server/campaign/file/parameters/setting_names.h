#pragma once
// What the names of parameters mean that are none of the model: [EXPERIMENT.]NUMBER.

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "server/campaign/file/parameters/experiment_numbers.h"
#include "server/campaign/file/text/problem_list.h"

namespace calib::campaign {

/// What a name means. Nothing: neither `setting` nor `problem`.
struct SettingNamed {
  std::optional<SettingOf> setting{};
  std::string unit{};
  std::string meaning{};  ///< "the setting opening of a, b"
  std::string problem{};  ///< a sentence, where it has two meanings
};

/// `derived`: from a campaign whose experiments may be no more, so that a number of none of these
/// has a meaning all the same: it changes nothing.
SettingNamed FindSetting(const std::string& name, const std::vector<ExperimentOutline>& outlines,
                         bool derived = false);

/// Every name that FindSetting() knows; those without an experiment first.
std::vector<std::string> SettingNames(const std::vector<ExperimentOutline>& outlines);

/// A name that may be calibrated, for listings.
struct Calibratable {
  std::string name;  ///< without an experiment
  std::string unit;
  std::string meaning;
  std::vector<std::string> experiments;  ///< that have it; none: it is of the model
};
/// The settings of a campaign's text and the parameters of its model.
std::vector<Calibratable> CalibratableIn(const std::string& yaml_text, const Campaign& campaign);

/// Problems with experiments that are called as an effect or a group of numbers is, and with what
/// stands at as_stated.
void CheckExperimentNames(const std::vector<ExperimentOutline>& outlines, const Campaign& campaign,
                          ProblemList& problems);

/// A problem, one sentence and the later parameter's name, for each number of an experiment that
/// two parameters, calibrated or tied, set.
struct SetTwice {
  std::string name;
  std::string problem;
};
std::vector<SetTwice> NumbersSetTwice(const Campaign& campaign);

/// What parameters do that is not said by their names: of which experiments a setting is, which are
/// rounded, what is tied. One sentence each.
std::vector<std::string> ParameterNotes(const Campaign& campaign);

/// Gives the experiments of a file the medians of the priors where calibrated or tied numbers are
/// left out, so that everything that is derived from them has a nominal value.
void StateNominalValues(YamlNode& file, const Campaign& campaign);
/// The density of the campaign's model likewise.
void StateNominalDensity(const YamlNode& file, Campaign& campaign);

/// Numbers that parameters, calibrated or tied, set in every experiment that has them.
std::set<std::string> SettingsOfAll(const Campaign& campaign);

/// Numbers of an experiment of another file that stand there, and that these parameters of a
/// campaign would change if it were one of the campaign's.
std::vector<std::string> StatedBeside(const YamlNode& experiment, const Campaign& campaign);

}  // namespace calib::campaign
