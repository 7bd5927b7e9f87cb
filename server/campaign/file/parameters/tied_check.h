#pragma once
// Parameters with `equal_to`: their formulas read, their order found, their values held against
// what is admissible, before anything runs.

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// A parameter as the file ties it.
struct TieAsWritten {
  std::string name;  ///< dotted
  std::string unit;  ///< SI; empty: nothing says it, that of what it stands for
  Range range;       ///< admissible, in that unit
  std::string text;  ///< what stands at equal_to
  std::optional<SettingOf> setting{};
};

/// Takes a problem, one sentence, with a tied parameter.
using SayOfTied = std::function<void(const std::string& name, const std::string& message)>;

/// Puts these into campaign.tied, each behind those that it follows from. A problem where a formula
/// cannot be read, names what is neither calibrated nor fixed nor tied, or names nothing; where a
/// parameter is fixed too, or follows from itself; and where one stands for another that measures
/// something else. Call when all parameters have been read.
void TieParameters(const std::vector<TieAsWritten>& ties, Campaign& campaign, const SayOfTied& say);

/// A problem for each tied parameter that is not admissible at a corner, an edge or the middle of
/// the prior: every combination of lower end, median and upper end of what it follows from (of the
/// first eight; one in 1000 where a prior has no end), the constraints met, all others at their
/// medians. Call when constraints have been read.
void CheckTiedValues(const Campaign& campaign, const SayOfTied& say);

}  // namespace calib::campaign
