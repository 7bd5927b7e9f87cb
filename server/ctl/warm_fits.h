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
#include "server/ctl/effect_screen.h"
#include "server/ctl/fitted_campaign.h"
#include "server/ctl/response.h"
#include "server/ctl/warm_fit.h"

namespace calib::ctl {

class WarmFits {
 public:
  /// screen: its runs teach the emulators too. response: of the base model, made before Fit. All
  /// must outlive it.
  WarmFits(const FittedCampaign& base, const EffectScreen& screen, const Response& response)
      : base_(base), screen_(screen), response_(response) {}

  /// Two batches of each of `first`, as far as they go; then the most promising go on, until each
  /// has stalled or as many evaluations have been made as the campaign has, or as `most` allows;
  /// Least() in any case. Once all have stalled, those of `later` are begun with what is left, in
  /// their order. promised: by effect, the rms error that the screen expects with it over that
  /// without: how close a refit may come yet.
  /// Errors: those of the runs.
  absl::Status Fit(std::vector<std::string> first, const std::vector<std::string>& later,
                   std::map<std::string, double> promised, std::optional<std::int64_t> most = {});
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
  double Chi2(const std::string& effect) const;
  /// The begun fit that comes closest.
  const WarmFit& Closest() const;
  /// Empty when every fit has stalled.
  std::optional<std::string> Next() const;
  absl::StatusOr<Eigen::MatrixXd> PointsFor(const std::string& effect) const;
  report::RunTable RunsFor(const std::string& effect) const;
  void Judge(const std::string& effect);
  inference::FittedModel ByRuns(const report::RunTable& runs) const;
  bool ByMean() const { return base_.readings().measured; }

  const FittedCampaign& base_;
  const EffectScreen& screen_;
  const Response& response_;
  int samples_ = 0;  // of a batch
  int spent_ = 0;    // evaluations of the batches, reused ones too
  std::vector<std::string> begun_;
  std::map<std::string, double> promised_;
  std::int64_t evaluations_ = 0;
  std::map<std::string, WarmFit> fits_;
};

/// What orders the refits, the lowest first: the rms that is left to explain where the fit stands or
/// where the screen expects it to end, whichever is less, dearer with every batch that has been made.
/// chi2, base: of the fit so far and of the model without the effect, >= 0, may be infinite;
/// promised: rms the screen expects over the base model's, >= 0 (above 1: as 1).
double PriceOf(double chi2, double base, double promised, int batches);

/// Calibrated parameters of a campaign at a row of `points`, by name.
std::map<std::string, double> PointOf(const report::CampaignView& view,
                                      const Eigen::MatrixXd& points, Eigen::Index row);

}  // namespace calib::ctl
