#pragma once
// From the measured control column to the path that the model is driven along: turning points are
// kept, the noise between them is removed, every reading keeps its own load step.

#include <optional>
#include <string>
#include <vector>

#include "dem/model/scenario.h"

namespace calib::campaign {

struct ControlPath {
  std::vector<dem::ControlPoint>
      points;  ///< one per reading, in order; load_step = index of the reading
  std::vector<double>
      travelled;  ///< path length of the control since the start of loading, at each reading
  std::vector<std::size_t> turning;  ///< readings at which the direction changes, ascending
  double reversal = 0;               ///< smallest excursion that counted as a turning point
};

/// Excursions of the control below this many sd of its stated noise are noise [-].
inline constexpr double kNoiseThatTurns = 4;

/// Cleans a measured control; loading starts at `start` (0 for strains, the start pressure for
/// stresses). Excursions smaller than the reversal threshold are noise; between turning points the
/// readings are made monotone by isotonic regression, so that readings may come to stand at the
/// same control and still each be a state. The threshold is 4 noise when noise (standard deviation)
/// is given; otherwise six robust standard deviations of the second differences, held between 0.1 %
/// and 2 % of the range. A first reading on the other side of the start than all that follow, by at
/// most 2 % of the range, is an offset of the gauge and no loading, unless offset_is_loading. Pure;
/// readings finite.
ControlPath CleanControl(const std::vector<double>& readings, double start,
                         std::optional<double> noise, bool offset_is_loading = false);

/// The readings as they are, each a run of its own: for controls that are no path. Readings count
/// as equally far apart.
ControlPath AsRead(const std::vector<double>& readings);

/// What the stages are found from, one value per reading; empty: not measured.
struct StageCurves {
  std::vector<double> strength = {};  ///< a deviatoric observable
  std::vector<double> volume = {};    ///< volumetric strain
};

/// Loading stage of each reading: initial_loading, then unload_1, reload_1, unload_2, ... at the
/// turning points. Primary loading is the first stage with the readings of later ones that go
/// beyond all before them. Where its strength has a clear peak (it falls by 3 % of its rise behind
/// it), its readings are pre_peak beyond half of the peak, peak within 3 % of the rise about it,
/// post_peak behind. Its end is steady_state where over its last fifth or more the trend of
/// strength is below 3 % of its rise and that of volumetric strain below 5 % of the control's.
std::vector<std::string> NameSegments(const ControlPath& path, const StageCurves& curves);

}  // namespace calib::campaign
