#pragma once
// What the posterior mean leaves unexplained along the loading path, as a process of its own, by
// observable.

#include <string>
#include <vector>

#include "inference/discrepancy/discrepancy.h"
#include "server/report/views/campaign_view.h"
#include "server/report/views/comparison.h"
#include "server/report/views/predictions.h"

namespace calib::report {

/// The process of one observable over the fitted experiments that share a control.
struct FittedDiscrepancy {
  std::string observable, control;
  std::vector<std::size_t>
      experiments;  ///< indices in the campaign, in the order of the fit's curves
  inference::Discrepancy fit;
};

/// Residuals are those of Compare(), with the covariance of noise and scatter. Empty where the
/// errors are not stated independently (noise inferred or tempered): misfit and error cannot be
/// told apart then.
std::vector<FittedDiscrepancy> FitDiscrepancies(
    const CampaignView& view, const std::vector<ExperimentPrediction>& predictions);

/// The discrepancy at the readings of an experiment, of this campaign or of another one that is
/// predicted from it, whose model curve is given; it counts as the fitted experiment with the same
/// test and settings, if there is one. Empty mean: nothing is known of this observable and control.
inference::DiscrepancyBand DiscrepancyAt(const CampaignView& fitted,
                                         const std::vector<FittedDiscrepancy>& discrepancies,
                                         const campaign::Experiment& experiment,
                                         const std::string& observable,
                                         const Eigen::VectorXd& model);

/// Fills comparison.discrepancies.
void AddDiscrepancies(const CampaignView& view,
                      const std::vector<ExperimentPrediction>& predictions, Comparison& comparison);

}  // namespace calib::report
