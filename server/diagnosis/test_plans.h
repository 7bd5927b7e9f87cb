#pragma once
// Tests that could be done next: those of the catalogue that the campaign's readings can be taken
// of, over a grid of their settings.

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/campaign/file/text/yaml_tree.h"
#include "server/campaign/model/campaign.h"

namespace calib::diagnosis {

/// What a measurement is expected to tell.
struct PlanForecast {
  double bits = 0;     ///< about which model is right
  double decides = 0;  ///< chance of one answer, and that it is right (inference::Forecast)
  double wrong = 0;    ///< chance that a wrong effect is named
  int runs = 0;        ///< of the test that this rests on; of a repeat those of the design
};

struct PlannedExperiment {
  std::string test;
  /// SI; in addition to the test's own `porosity` (of another specimen) and `loading_rate` (1/s).
  std::map<std::string, double> settings;
  std::optional<double> unloading_at{};  ///< value of the control at which it turns back, once
  std::string control;                   ///< what drives it,
  std::vector<double> path;              ///< and its values at the readings, SI
  /// Chance to tell two rivals apart at the 1 % level: the lowest of the pairs that are told apart.
  double expected_power = 0;
  double distance = 0;      ///< between these two, in sd of a measurement
  int points = 1;           ///< of each rival that it was run at: of that with the fewest
  double core_seconds = 0;  ///< of one run, mean over the models; 0: not known
  std::vector<std::pair<std::string, std::string>> together{};  ///< pairs that are not told apart
  /// The same of the rivals against none of them (NoneOfThese); where that was asked for.
  std::optional<double> distance_from_none{}, power_against_none{};
  /// By runs of its own; then expected_power is its `decides`.
  std::optional<PlanForecast> forecast{};
  std::string repeats{};  ///< experiment of the campaign that it is, on another specimen; or empty
  /// One of Campaign::next, which `test` names; `told` are its settings then.
  bool of_next = false;
  campaign::ProgramSettings told{};
};

struct TestPlan {
  PlannedExperiment experiment;
  std::string name;  ///< of the experiment in the derived campaign
  std::string file;  ///< of its data
};

/// The first fitted experiment, which plans follow in everything that they do not change.
const campaign::Experiment& PatternOf(const campaign::Campaign& campaign);

/// The pattern's test with nothing changed, as far as a plan may change it: each of PlansFor() is
/// this with one thing changed. Under a pressure it is monotonic at the plans' middle pressure.
PlannedExperiment AsDone(const campaign::Campaign& campaign);

/// Where the pattern is driven by the axial strain under a pressure: its test at a quarter of the
/// lowest and four times the highest pressure, and every test that one pressure and an axial strain
/// define at their geometric mean: monotonic, with an unloading where it may reverse (of the
/// pattern's test half-way or after a fifth of the way), where packings are generated with a
/// specimen looser and denser by 0.02 in porosity, and where it has a loading_rate at a quarter and
/// four times it. An initial stress grows with the pressure. Otherwise the plans of
/// setting_plans.h. May be empty.
std::vector<PlannedExperiment> PlansFor(const campaign::Campaign& campaign);

/// With a name and a file of data each; numbers from `first` on.
std::vector<TestPlan> Named(std::vector<PlannedExperiment> plans, std::size_t first);

/// Text of the plan's file: the way of the control, and at it these curves of the pattern's
/// observables; none: ones, where only the control is read.
std::string DataOf(const PlannedExperiment& planned, const campaign::Experiment& pattern,
                   const std::vector<Eigen::VectorXd>& curves = {});

/// The entry of an experiment in a campaign's file, with the nominal values of settings that are
/// calibrated and left out there; empty: it is not there.
std::optional<campaign::YamlNode> EntryNamed(const std::string& campaign_file,
                                             const campaign::Campaign& campaign,
                                             const std::string& experiment);

/// The pattern's entry in the campaign file with another test, settings and measurement. What
/// parameters of the campaign would change of the settings that are planned stays as planned.
campaign::YamlNode EntryFor(const TestPlan& plan, const campaign::Experiment& pattern,
                            const campaign::YamlNode& original,
                            const campaign::Campaign& campaign = {});

}  // namespace calib::diagnosis
