#pragma once
// The model refitted with one effect more, and how it was judged.

#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "inference/diagnosis/screen.h"
#include "server/diagnosis/strength_scale.h"
#include "server/report/views/campaign_view.h"
#include "server/report/views/run_table.h"

namespace calib::diagnosis {

struct WarmFit {
  report::CampaignView view{};  ///< its first batch, a campaign of the extended model
  report::RunTable runs{};      ///< of all batches
  Eigen::MatrixXd diverged{};   ///< where a run came to no end, m x d, SI
  int iterations = 0;
  std::vector<double> chi2_after{};      ///< the smallest chi2, batch after batch
  int idle = 0;                          ///< batches since one came clearly closer
  bool stalled = false;                  ///< several batches have come no closer
  std::map<std::string, double> best{};  ///< parameters of the point with the smallest chi2, SI
  /// Others that the readings do not exclude (PointsNear).
  std::vector<std::map<std::string, double>> near{};
  double rms = 0;                  ///< smallest of a point, residual over noise sd
  inference::FittedModel model{};  ///< runs, or mean histories, as points
  /// As of a model that fits nowhere until it has been judged.
  inference::Adequacy adequacy{.chi2 = std::numeric_limits<double>::infinity(), .p_value = 0};
  inference::Advantage over_base{};
  /// Chance of such a gain over the base model were that right; none where judged by runs.
  std::optional<double> gain_p_value{};
  /// Of a part of the data that it was not fitted to; none where there is one part.
  std::optional<double> left_out_error{};
  /// None before WeighEvidence, or where the emulator does not know the runs well enough.
  std::optional<ScaledEvidence> evidence{};

  /// False as long as its emulator knows too little of it, or not one run has ended.
  bool Judged() const { return std::isfinite(adequacy.chi2); }

  /// Closer than the base model, which it contains: judged by the same errors. One that is not has
  /// merely not been found.
  bool Found() const { return over_base.nats > 0; }

  /// Adequate, and clearly better than the base model. refits: of which this is one.
  bool Explains(double level, std::size_t refits) const {
    const bool better = gain_p_value ? *gain_p_value * static_cast<double>(refits) < level
                                     : over_base.nats > 2 * over_base.sd;
    return adequacy.p_value >= level && better;
  }
};

}  // namespace calib::diagnosis
