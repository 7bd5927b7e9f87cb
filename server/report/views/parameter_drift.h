#pragma once
// What a parameter would have to be in each experiment and each loading stage by itself. A
// parameter that must change with pressure, rate or stage is the mark of missing physics [Cheng et
// al. 2018, sec. 5.2: friction falls with the confining pressure where grains crush].

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/report/views/campaign_view.h"

namespace calib::report {

/// Posterior from one experiment alone, or from one stage of it alone.
struct PartialFit {
  std::string experiment;
  std::string segment;  ///< empty: all of the experiment
  double mean = 0;      ///< SI
  double sd = 0;
  double z = 0;  ///< distance from the common fit of all such parts, over its standard deviation
};

struct ParameterDrift {
  std::string parameter, unit;
  /// Probability of fits at least as far apart if one value served all experiments; empty with
  /// fewer than two experiments that say something about the parameter.
  std::optional<double> p_experiments;
  /// Probability of fits at least as far apart if one value served all stages; empty with fewer
  /// than two stages that say something about the parameter.
  std::optional<double> p_segments;
  /// Setting with which the fits of the experiments go up or down, and the change of the parameter
  /// per factor ten in it [SI] with its sd; empty: no setting takes two values, or no drift.
  std::string trend_with;
  double trend = 0, trend_sd = 0;
  std::vector<PartialFit> fits;  ///< experiments first, then stages, in the order of the campaign
};

/// The runs of the campaign are emulated and the parameters fitted to each part of the readings;
/// scatter and the emulator's error are in the widths: the scatter of packings and what refits of
/// them show where it was measured, that of single runs otherwise. Parts by which a
/// parameter stays as wide as its prior (sd above 0.8 of it) say nothing and are left out, and so
/// are parts with fewer than `kLeastReadings` readings and those that no emulator can be made of.
/// Deterministic. About a second for each part. Errors: FAILED_PRECONDITION without a known size of
/// the errors or with too few runs to emulate any part.
absl::StatusOr<std::vector<ParameterDrift>> ParameterDrifts(const CampaignView& view);

/// Readings of a stage or experiment below which it is not fitted alone.
inline constexpr int kLeastReadings = 6;

}  // namespace calib::report
