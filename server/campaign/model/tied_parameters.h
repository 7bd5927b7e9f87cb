#pragma once
// Parameters that follow from others by a formula, {equal_to: "2 * a + b"}: they have no prior, and
// a run gets their values when it is made. Pure.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dem/formula/formula.h"
#include "server/campaign/model/range.h"

namespace calib::campaign {

struct Campaign;

/// What a parameter is that is none of the model: a number of experiments.
struct SettingOf {
  std::string number;                    ///< "confining_pressure", "packing.porosity"
  std::vector<std::string> experiments;  ///< whose number it sets; none: it changes nothing, as in
                                         ///< a derived campaign that has no such experiment
  Range range{};                         ///< what all of them admit, SI
  bool whole = false;                    ///< a run takes the nearest whole number
};
/// The number that is of the model: density of the grains.
inline constexpr const char* kDensityOfGrains = "density";

struct TiedParameter {
  std::string name;  ///< dotted
  std::string unit;  ///< SI
  Range range;       ///< admissible, in that unit
  std::string text;  ///< the formula as written
  dem::Formula formula;
  /// Calibrated, fixed or tied parameters that it mentions, in the order of formula.used().
  std::vector<std::string> inputs;
  std::optional<SettingOf> setting{};  ///< empty: a parameter of the model
};

/// The tied parameter of this name; nullptr: there is none.
const TiedParameter* FindTied(const Campaign& campaign, const std::string& name);

/// Values of Campaign::tied in their order, SI; NaN or infinite where a formula is not defined.
/// values: in the order of Campaign::parameters.
std::vector<double> TiedValues(const Campaign& campaign, std::span<const double> values);

/// Indices into Campaign::parameters of those that a tied parameter follows from in the end,
/// ascending.
std::vector<std::size_t> FollowsFrom(const Campaign& campaign, const TiedParameter& tied);

}  // namespace calib::campaign
