#pragma once
// The scatter of the model as a posterior's record holds it.

#include <Eigen/Core>
#include <string>

#include "calib/v1/campaign.pb.h"
#include "inference/scatter/scatter.h"

namespace calib::report {

/// Null where the record has none of this observable. The posterior must outlive it.
const v1::Posterior::Scatter* FindScatter(const v1::Posterior& posterior,
                                          const std::string& experiment,
                                          const std::string& observable);

/// in:  travelled, path length at each of the n readings of the experiment (in units of the
///      control), for records older than clocks
/// out: sd and clock of size n; experiment and observable are 0
inference::GroupScatter GroupScatterOf(const v1::Posterior::Scatter& record,
                                       const Eigen::VectorXd& travelled);

}  // namespace calib::report
