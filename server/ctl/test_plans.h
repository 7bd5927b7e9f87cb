#pragma once
// Tests that could be done next: those of the catalogue that the campaign's readings can be taken
// of, over a grid of pressure, density and unloading.

#include <map>
#include <string>
#include <vector>

#include "server/campaign/campaign.h"
#include "server/campaign/yaml_tree.h"

namespace calib::ctl {

struct PlannedExperiment {
  std::string test;
  std::map<std::string, double> settings;  ///< SI; `porosity`: of another specimen
  bool unloading = false;                  ///< once, half-way of the loading
  /// Chance to tell the two closest of the rivals apart at the 1 % level.
  double expected_power = 0;
  double distance = 0;  ///< between these two, in sd of a measurement
};

struct TestPlan {
  PlannedExperiment experiment;
  std::string name;  ///< of the experiment in the derived campaign
  std::string file;  ///< of its data
  std::string data;  ///< text of the file: the way of the control, 40 readings or more
};

/// The first fitted experiment, which plans follow in everything that they do not change.
const campaign::Experiment& PatternOf(const campaign::Campaign& campaign);

/// The campaign's own test at a quarter of its lowest and four times its highest pressure,
/// and every test that one pressure and an axial strain define at their geometric mean: monotonic,
/// with an unloading where it may reverse, and, where packings are generated, with a specimen
/// looser and denser by 0.02 in porosity. None for campaigns without a confining pressure, at a
/// real loading rate, from an initial stress, or not driven by the axial strain. Rates are no part
/// of the grid: stages are quasi-static.
/// A clause: why there are none; empty where there may be.
std::string WhyNoPlans(const campaign::Campaign& campaign);
std::vector<TestPlan> PlansFor(const campaign::Campaign& campaign);

/// The pattern's entry in the campaign file with another test, settings and measurement.
campaign::YamlNode EntryFor(const TestPlan& plan, const campaign::Experiment& pattern,
                            const campaign::YamlNode& original);

}  // namespace calib::ctl
