#pragma once
// From the measured control column to the path that the model is driven along: turning points are
// kept, the noise between them is removed, every reading keeps its own load step.

#include <optional>
#include <string>
#include <vector>

#include "dem/simulation/scenario.h"

namespace calib::campaign {

struct ControlPath {
  std::vector<dem::ControlPoint>
      points;  ///< one per reading, in order; load_step = index of the reading
  std::vector<double>
      travelled;  ///< path length of the control since the start of loading, at each reading
  std::vector<std::size_t> turning;  ///< readings at which the direction changes, ascending
  double reversal = 0;               ///< smallest excursion that counted as a turning point
};

/// Cleans a measured control; loading starts at `start` (0 for strains, the start pressure for
/// stresses). Excursions smaller than the reversal threshold are noise; between turning points the
/// readings are made monotone by isotonic regression, so that readings may come to stand at the
/// same control and still each be a state. The threshold is 4 noise when noise (standard deviation)
/// is given; otherwise six robust standard deviations of the second differences, held between 0.1 %
/// and 2 % of the range. Pure; readings finite.
ControlPath CleanControl(const std::vector<double>& readings, double start,
                         std::optional<double> noise);

/// The readings as they are, each a run of its own: for controls that are no path. Readings count as
/// equally far apart.
ControlPath AsRead(const std::vector<double>& readings);

/// Loading stage of each reading: initial_loading, then unload_1, reload_1, unload_2, ... at the
/// turning points. Where `strength` (a deviatoric observable at each reading; empty: none) has a
/// clear peak within the first stage, the part beyond half of the peak is pre_peak and the part
/// behind it post_peak.
std::vector<std::string> NameSegments(const ControlPath& path, const std::vector<double>& strength);

}  // namespace calib::campaign
