#pragma once
// Which parameters move what: global sensitivity of the outputs of a campaign's runs, and how the
// parameters go with the bulk properties.

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/sensitivity/emulated_output.h"
#include "server/campaign/model/words.h"
#include "server/report/views/campaign_view.h"

namespace calib::report {

struct Quantity {
  std::string experiment;
  std::string
      name;  ///< a bulk property, or "final_" and an observable: its value at the last reading
  std::string unit;                        ///< SI
  int runs = 0;                            ///< finished runs that have it
  inference::OutputSensitivity prior;      ///< over the prior
  inference::OutputSensitivity posterior;  ///< correlations, mean and sd over the posterior; empty:
                                           ///< none, or nothing explained
};

struct Sensitivity {
  std::vector<std::string> parameters;
  bool independent = true;  ///< false: correlated or constrained priors have no Sobol indices
  /// Where the points of the posterior come from; kNone: there are none.
  campaign::PosteriorSource points_from = campaign::PosteriorSource::kNone;
  std::vector<Quantity> quantities;
  std::vector<std::string> left_out;  ///< "tx02: secant_modulus: ...", a clause each
  std::vector<std::string> warnings;  ///< Warnings() of the posterior
};

/// All experiments, held-out ones where runs have them. Deterministic. Errors: FAILED_PRECONDITION
/// with too few finished runs.
absl::StatusOr<Sensitivity> AnalyseCampaign(const CampaignView& view);

}  // namespace calib::report
