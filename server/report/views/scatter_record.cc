#include "server/report/views/scatter_record.h"

namespace calib::report {

const v1::Posterior::Scatter* FindScatter(const v1::Posterior& posterior,
                                          const std::string& experiment,
                                          const std::string& observable) {
  for (const v1::Posterior::Scatter& scatter : posterior.scatter()) {
    if (scatter.experiment() == experiment && scatter.observable() == observable) return &scatter;
  }
  return nullptr;
}

inference::GroupScatter GroupScatterOf(const v1::Posterior::Scatter& record,
                                       const Eigen::VectorXd& travelled) {
  const Eigen::Index n = travelled.size();
  inference::GroupScatter scatter{.sd = Eigen::VectorXd::Zero(n),
                                  .clock = Eigen::VectorXd(n),
                                  .length = record.correlation_length(),
                                  .share = record.share()};
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto reading = static_cast<int>(i);
    if (reading < record.sd_size()) scatter.sd[i] = record.sd(reading);
    if (reading < record.clock_size()) {
      scatter.clock[i] = record.clock(reading);
    } else {
      scatter.clock[i] = scatter.length > 0 ? travelled[i] / scatter.length
                                            : inference::kFarApart * static_cast<double>(i);
    }
  }
  return scatter;
}

}  // namespace calib::report
