#pragma once
// The numbers of an experiment that a run reads and that may be calibrated: settings of its test,
// of its preparation and of the recipe of its specimen.

#include <set>
#include <string>
#include <vector>

#include "dem/registry/catalog.h"
#include "server/campaign/file/text/yaml_tree.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// How the sizes of a recipe's grains are given; kNone: there is no recipe.
enum class SizesBy { kNone, kMean, kCurve, kLogNormal };

/// What of an experiment its numbers depend on.
struct ExperimentOutline {
  std::string name{};
  int line = 0;
  const dem::TestInfo* test = nullptr;  ///< nullptr: unknown; it might have any number
  std::string control{};
  SizesBy sizes = SizesBy::kNone;
  std::set<std::string> stated{};     ///< numbers whose value stands in the file
  std::set<std::string> as_stated{};  ///< that no parameter changes
  std::string batch{};
};

/// As the file has it, whatever is wrong with it.
ExperimentOutline OutlineOf(const YamlNode& experiment);
/// Of each experiment of a file; `experiments` may be nullptr or no list.
std::vector<ExperimentOutline> OutlinesOf(const YamlNode* experiments);

struct ExperimentNumber {
  std::string name;  ///< "confining_pressure", "packing.porosity"
  std::string unit;  ///< SI
  Range range;       ///< admissible, in that unit
  bool whole = false;
  std::string meaning{};
  /// Without it the experiment is another one: a name without an experiment means those that state
  /// it, if any does.
  bool optional = false;
};

std::vector<ExperimentNumber> NumbersOf(const ExperimentOutline& outline);
/// Those that an experiment of any test can have, but for shares of materials; by name and unit
/// once.
std::vector<ExperimentNumber> NumbersOfAllTests();
/// Before the name of a material whose share of the grains is a number.
inline constexpr const char* kShareOfGrains = "materials.grains.";

/// Names of the groups that numbers are dotted with: packing, staging, ...; no experiment may have
/// one.
const std::vector<std::string>& GroupsOfNumbers();

/// Gives the experiment of a file a value of a number that is left out there, as if the line `line`
/// said so. Nothing is changed where it stands, or cannot stand.
void StateInFile(const std::string& number, double value, int line, YamlNode& experiment);

}  // namespace calib::campaign
