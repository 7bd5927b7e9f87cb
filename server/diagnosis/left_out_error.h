#pragma once
// How well calibrated models predict the parts of the fitted data that they are not fitted to.

#include <Eigen/Dense>
#include <optional>
#include <vector>

#include "server/client/laboratory.h"
#include "server/report/views/campaign_view.h"

namespace calib::diagnosis {

/// Each experiment (each stage of loading where only one is fitted) left out in turn, predicted by
/// the point that is best for the others: inference::LeftOutError, in sd of a measurement.
/// nuisance: see ErrorsOfMeasurements. None where there is one part only, or the emulator does not
/// predict the runs of the model.
std::optional<double> LeftOutErrorOf(client::Laboratory& laboratory,
                                     const report::CampaignView& view,
                                     const std::vector<Eigen::VectorXd>& nuisance);

/// Of two models on the same readings, one of which has an effect more.
struct LeftOutErrors {
  double without = 0, with = 0;
};

/// As LeftOutErrorOf, both by the errors of the model without the effect: covariances that were
/// estimated apart differ by chance. None where either is not known.
std::optional<LeftOutErrors> LeftOutErrorsOf(client::Laboratory& laboratory,
                                             const report::CampaignView& without,
                                             const report::CampaignView& with,
                                             const std::vector<Eigen::VectorXd>& nuisance);

/// Which of two errors within one sd, as a right model has them, is larger is chance: worse is what
/// is beyond that, and larger than without the effect. Where one is not known: false.
bool WorseLeftOut(const std::optional<double>& without, const std::optional<double>& with);

}  // namespace calib::diagnosis
