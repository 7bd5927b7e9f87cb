#pragma once
// The model refitted with one effect more, for the few effects that a screen ranks first: small
// batches of runs at points that all that has been run suggests (warm_points.h), until the fit is
// adequate or comes no closer, continued where that promises most. Judged by runs, not by the
// emulator: what an emulator does not know would excuse any misfit.

#include <Eigen/Dense>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/diagnosis/screen.h"
#include "server/ctl/effect_screen.h"
#include "server/ctl/fitted_campaign.h"
#include "server/ctl/response.h"
#include "server/ctl/strength_scale.h"

namespace calib::ctl {

struct WarmFit {
  report::CampaignView view{};  ///< its first batch, a campaign of the extended model
  report::RunTable runs{};      ///< of all batches
  int iterations = 0;
  int idle = 0;                          ///< batches since one came clearly closer
  bool stalled = false;                  ///< several batches have come no closer
  std::map<std::string, double> best{};  ///< parameters of the run with the smallest chi2, SI
  double rms = 0;                        ///< smallest of a run, residual over noise sd
  inference::FittedModel model{};        ///< the runs as points
  inference::Adequacy adequacy{};
  inference::Advantage over_base{};
  /// Of a part of the data that it was not fitted to; none where there is one part.
  std::optional<double> left_out_error{};
  /// None before WeighEvidence, or where the emulator does not know the runs well enough.
  std::optional<ScaledEvidence> evidence{};

  /// As close as noise and scatter allow: more runs are better spent on its rivals.
  bool Satisfied() const { return adequacy.degrees > 0 && adequacy.chi2 <= adequacy.degrees; }

  /// Adequate, and clearly better than the base model.
  bool Explains(double level) const {
    return adequacy.p_value >= level && over_base.nats > 2 * over_base.sd;
  }
};

class WarmFits {
 public:
  /// screen: its runs teach the emulators too. response: of the base model, made before Fit. All
  /// must outlive it.
  WarmFits(const FittedCampaign& base, const EffectScreen& screen, const Response& response)
      : base_(base), screen_(screen), response_(response) {}

  /// Fits all of them and continues, the most promising first, until each has stalled or as many
  /// samples have been run as the campaign has. Errors: those of the
  /// runs.
  absl::Status Fit(const std::vector<std::string>& effects);

  /// A fit that needed no runs.
  void Adopt(const std::string& effect, WarmFit fit) {
    fits_.insert_or_assign(effect, std::move(fit));
  }

  const WarmFit* Find(const std::string& effect) const;
  std::int64_t evaluations() const { return evaluations_; }

  /// The base model judged in the same way, by its runs.
  inference::FittedModel BaseByRuns() const;

  /// The evidence of a fit that has runs; and that of the base model on an emulator of its own runs
  /// (no effect, hence one figure; none as in WarmFit).
  void WeighEvidence(const std::string& effect);
  std::optional<double> BaseLogEvidence() const;

 private:
  absl::StatusOr<std::string> FirstText(const std::string& effect) const;
  absl::Status Continue(const std::string& effect);
  /// nullptr when every fit has stalled.
  const std::string* Next(const std::vector<std::string>& effects) const;
  absl::StatusOr<Eigen::MatrixXd> PointsFor(const std::string& effect) const;
  report::RunTable RunsFor(const std::string& effect) const;
  void Judge(WarmFit& fit) const;
  inference::FittedModel ByRuns(const report::RunTable& runs) const;

  const FittedCampaign& base_;
  const EffectScreen& screen_;
  const Response& response_;
  int samples_ = 0;  // of a batch
  std::int64_t evaluations_ = 0;
  std::map<std::string, WarmFit> fits_;
};

/// Calibrated parameters of a campaign at a row of `points`, by name.
std::map<std::string, double> PointOf(const report::CampaignView& view,
                                      const Eigen::MatrixXd& points, Eigen::Index row);

}  // namespace calib::ctl
