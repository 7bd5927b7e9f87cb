#pragma once
// The model refitted with one effect more, for the few effects that a screen ranks first: small
// batches of runs at points that all that has been run suggests (warm_points.h), until the fit is
// adequate or comes no closer, continued where that promises most. Where the scatter between
// packings has been measured, a fit is judged by its mean history where an emulator knows that
// well; single runs, each on one of few packings, would make it a lottery. Where it has not, by
// runs: what an emulator does not know would excuse any misfit.

#include <Eigen/Dense>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/diagnosis/screen.h"
#include "server/diagnosis/effect_screen.h"
#include "server/diagnosis/fitted_campaign.h"
#include "server/diagnosis/refit_order.h"
#include "server/diagnosis/response.h"
#include "server/diagnosis/warm_fit.h"

namespace calib::diagnosis {

class WarmFits {
 public:
  /// screen: its runs teach the emulators too. response: of the base model, made before Fit. level:
  /// of the tests by which a fit explains the readings. All must outlive it.
  WarmFits(const FittedCampaign& base, const EffectScreen& screen, const Response& response,
           double level)
      : base_(base), screen_(screen), response_(response), level_(level) {}

  /// kLeastBatches of each of `first`, as far as they go; then batches go where NextRefit says,
  /// until there is nothing left that goes on, or as many evaluations have been made as the
  /// campaign has, or as `most` allows; Least() in any case. Errors: those of the runs.
  absl::Status Fit(const RefitOrder& order, std::optional<std::int64_t> most = {});
  /// Model evaluations of two batches of one effect.
  std::int64_t Least() const;

  /// A fit that needed no runs.
  void Adopt(const std::string& effect, WarmFit fit) {
    fits_.insert_or_assign(effect, std::move(fit));
  }

  const WarmFit* Find(const std::string& effect) const;
  const std::map<std::string, WarmFit>& all() const { return fits_; }
  std::int64_t evaluations() const { return evaluations_; }

  /// The base model judged in the same way.
  inference::FittedModel Base() const;

  /// The evidence of the fits that have runs, and that of the base model on an emulator of its own
  /// runs (no effect, hence one figure; none as in WarmFit).
  void WeighEvidence();
  std::optional<double> BaseLogEvidence() const;

 private:
  absl::StatusOr<std::string> FirstText(const std::string& effect) const;
  absl::Status Begin(const std::vector<std::string>& effects);
  absl::Status Continue(const std::string& effect);
  std::vector<RefitStanding> Standings() const;
  absl::StatusOr<Eigen::MatrixXd> PointsFor(const std::string& effect) const;
  void Add(const report::CampaignView& batch, WarmFit& fit) const;
  report::RunTable RunsFor(const std::string& effect) const;
  void Judge(const std::string& effect);
  inference::FittedModel ByRuns(const report::RunTable& runs) const;
  bool ByMean() const { return base_.readings().measured; }

  const FittedCampaign& base_;
  const EffectScreen& screen_;
  const Response& response_;
  double level_;
  int samples_ = 0;  // of a batch
  int spent_ = 0;    // evaluations of the batches, reused ones too
  std::vector<std::string> begun_;
  std::int64_t evaluations_ = 0;
  std::map<std::string, WarmFit> fits_;
};

/// Up to three points beside the closest that the readings do not exclude
/// (inference::PointsNotExcluded). points: where the model's histories are.
std::vector<std::map<std::string, double>> PointsNear(const report::CampaignView& view,
                                                      const Eigen::MatrixXd& points,
                                                      const inference::FittedModel& model);

/// Calibrated parameters of a campaign at a row of `points`, by name.
std::map<std::string, double> PointOf(const report::CampaignView& view,
                                      const Eigen::MatrixXd& points, Eigen::Index row);

}  // namespace calib::diagnosis
