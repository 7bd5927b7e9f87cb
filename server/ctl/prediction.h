#pragma once
// The posterior of a campaign propagated to another test: a table of runs at its draws, run by the
// workers like any others, and what follows from them.

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/discrepancy/discrepancy.h"
#include "inference/prediction/prediction.h"
#include "server/client/laboratory.h"
#include "server/ctl/predicted_tests.h"

namespace calib::ctl {

struct PredictionOptions {
  int draws = 20;                   ///< runs, of each test
  std::vector<std::string> exceed;  ///< OBSERVABLE=LEVEL with an optional unit
};

struct PredictedObservable {
  std::string experiment, observable, control_name;
  std::string unit = "1", control_unit = "1";  ///< SI
  std::vector<double> control;                 ///< at each reading, SI
  inference::QuantityPrediction quantity;      ///< at each reading, SI
  /// Standard deviation of the error of the measurement that is predicted, at each reading; part of
  /// quantity.sd, of its quantiles and of the exceedance. Empty: the test states none.
  Eigen::VectorXd sd_noise{};
  std::vector<double> measured;  ///< SI; empty: not measured
  /// Discrepancy of the model, learnt where it was calibrated (model - measurement); part of
  /// quantity.sd_model. Empty: nothing is known of it.
  inference::DiscrepancyBand discrepancy{};
  struct Exceedance {
    double level = 0;             ///< SI
    Eigen::VectorXd probability;  ///< at each reading
    inference::ExceedanceParts parts;
    double anywhere = 0;  ///< that it is reached somewhere, errors included
  };
  std::vector<Exceedance> exceedance;
};

struct Prediction {
  std::string parent, campaign;  ///< ids
  int runs = 0;                  ///< finished, of each test
  int failed = 0;
  std::vector<PredictedObservable> observables;
  std::vector<std::string> notes;  ///< whole sentences
};

/// Errors: INVALID_ARGUMENT for levels that name no observable; FAILED_PRECONDITION without a
/// posterior, with runs made elsewhere or when fewer than half of the runs of a test finish; those
/// of the runs.
absl::StatusOr<Prediction> Predict(client::Laboratory& laboratory,
                                   const report::CampaignView& parent, const PredictedTests& tests,
                                   const PredictionOptions& options);

std::string PredictionJson(const Prediction& prediction);
std::string PredictionText(const Prediction& prediction);

}  // namespace calib::ctl
