#pragma once
// The model refitted with one effect more, for the few effects that a screen ranks first: campaigns
// of few samples, continued an iteration at a time where that promises most.

#include <Eigen/Dense>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/diagnosis/screen.h"
#include "server/ctl/fitted_campaign.h"
#include "server/ctl/response.h"

namespace calib::ctl {

struct WarmFit {
  report::CampaignView view{};
  int iterations = 0;
  std::map<std::string, double> best{};  ///< parameters at the best point, SI
  double best_run = 0;                   ///< rms of the closest run, residual over noise sd
  double rms = 0;                        ///< of `best`: emulated where judged, else best_run
  /// Where the emulator of its runs is good enough to judge by.
  std::optional<inference::FittedModel> model{};
  inference::Adequacy adequacy{};
  inference::Advantage over_base{};

  /// Adequate, and clearly better than the base model.
  bool Explains(double level) const {
    return model && adequacy.p_value >= level && over_base.nats > 2 * over_base.sd;
  }
};

class WarmFits {
 public:
  /// nuisance: directions that a measurement may differ by for numerical reasons. All must outlive
  /// it.
  WarmFits(const FittedCampaign& base, const inference::FittedModel& base_model,
           const std::vector<Eigen::VectorXd>& nuisance)
      : base_(base), base_model_(base_model), nuisance_(nuisance) {}

  /// Fits all of them and continues, the most promising first, until each is judged or as many
  /// samples have been run as the campaign has (two iterations of each at least). Errors: those of
  /// the runs.
  absl::Status Fit(const std::vector<std::string>& effects);

  /// A fit that needed no runs.
  void Adopt(const std::string& effect, WarmFit fit) {
    fits_.insert_or_assign(effect, std::move(fit));
  }

  const WarmFit* Find(const std::string& effect) const;
  std::int64_t evaluations() const;

 private:
  absl::StatusOr<std::string> TextOf(const std::string& effect, int iterations) const;
  absl::Status FitOne(const std::string& effect, int iterations);
  void Judge(WarmFit& fit) const;

  const FittedCampaign& base_;
  const inference::FittedModel& base_model_;
  const std::vector<Eigen::VectorXd>& nuisance_;
  int samples_ = 0;  // of an iteration
  std::map<std::string, WarmFit> fits_;
};

/// Calibrated parameters of a campaign at a row of `points`, by name.
std::map<std::string, double> PointOf(const report::CampaignView& view,
                                      const Eigen::MatrixXd& points, Eigen::Index row);

}  // namespace calib::ctl
