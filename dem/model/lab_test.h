#pragma once
// A lab test as data: settings, observables, control, and the traits by which effects and checks
// know where they act.

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dem/model/parameter.h"

namespace calib::dem {

/// Admissible targets of a control, in its SI unit, bounds included.
struct ControlRange {
  double min = 0;
  double max = 0;
  bool whole = false;  ///< only whole numbers are admissible
};

/// A piece of a test's boundary that a mesh given by the user may replace.
struct MeshInfo {
  std::string name;
  std::string description;  ///< what it replaces, its origin and axes
};

/// What loads the frame that strains the specimen, and with it where effects of the apparatus act.
enum class RigLoad {
  kNone,        ///< no axial loading frame
  kDeviatoric,  ///< q against the cell pressure, which acts through a membrane; volume is measured
                ///< apart
  kAxial,       ///< the axial stress; volume follows from the axial strain
};

/// Catalogue entry of a lab test, with the traits that effects and checks ask for.
struct TestInfo {
  std::string name;
  std::string description;               ///< geometry, control, stages, what makes it fail
  std::vector<ParameterInfo> settings;   ///< e.g. confining_pressure
  std::vector<std::string> observables;  ///< names, in the order in which a state holds its values
  std::string control;  ///< the observable that drives the loading ("axial_strain")
  std::vector<std::string> other_controls = {};  ///< settings that may drive it instead; the one
                                                 ///< that does is not given as a setting
  bool needs_packing = true;  ///< false: bodies come from the settings, nothing is consolidated
  bool may_reverse = true;    ///< the control may go down again (unload-reload)
  std::string reference;      ///< paper and section
  bool poured = false;  ///< takes only the sizes of the packing's grains, which it pours itself; no
                        ///< consolidation, no staging
  bool separate_points = false;  ///< every value of the control is a run of its own, in any order
  bool one_pressure = false;     ///< a stress is held at confining_pressure throughout; in
                                 ///< simple_shear, unless constant_volume is set
  std::optional<ControlRange> control_range = {};  ///< empty: strains below 1, stresses above 0
  std::vector<MeshInfo> meshes = {};
  RigLoad rig_load = RigLoad::kNone;
  bool has_walls = false;  ///< grains, or the body, can touch a wall
  bool planar = false;     ///< everything moves in one plane
  bool fed_in = false;     ///< grains join while it runs: no mixture can be drawn beforehand
  std::vector<std::string> bodies =
      {};  ///< that may be of another material than the grains: names for MaterialUse::bodies
  bool stress_driven = false;  ///< the control is the mean stress [Pa] > 0, which all axes follow
  std::string stress_control = {};  ///< a stress [Pa] > 0 that may drive it in place of its
                                    ///< control, where kStressDriven is 1; empty: none may
};

/// Setting of a scenario, 0 or 1: the test is driven by its stress_control. It follows from the
/// control that a campaign names, and is none of TestInfo::settings.
inline constexpr const char* kStressDriven = "stress_driven";

/// Whether the control is a stress, with these settings.
bool IsStressDriven(const TestInfo& test, const std::map<std::string, double>& settings);

/// Whether the test strains one specimen in its periodic cell, consolidated before it is loaded.
inline bool InPeriodicCell(const TestInfo& test) { return test.needs_packing && !test.poured; }

/// The control of a test with these settings: its stress_control where they say so; the first of
/// its controls that is not among them, else the last.
std::string ControlOf(const TestInfo& test, const std::map<std::string, double>& settings);

}  // namespace calib::dem
