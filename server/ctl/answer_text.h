#pragma once
// Answers in words and tables, at most 100 columns wide.

#include <string>
#include <vector>

#include "calib/v1/campaign.pb.h"
#include "server/report/views/comparison.h"
#include "server/report/views/model_comparison.h"
#include "server/report/views/sensitivity.h"

namespace calib::ctl {

/// Identified parameters, evidence, effective samples and warnings.
std::string PosteriorText(const v1::Posterior& posterior, const std::vector<std::string>& warnings);

/// The answer for a table whose rows have run, which has no posterior.
std::string TableText(const v1::CampaignStatus& status);

/// Overall misfit in a sentence, then per observable and per loading stage.
std::string ComparisonText(const report::Comparison& comparison);

/// Rival models with evidence, Bayes factor to the best and probability.
std::string ModelsText(const report::ModelComparison& comparison);

/// First-order and total Sobol indices and rank correlations, per quantity.
std::string SensitivityText(const report::Sensitivity& sensitivity);

/// One campaign in a few lines.
std::string StatusText(const v1::CampaignStatus& status);

}  // namespace calib::ctl
