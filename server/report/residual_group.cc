#include "server/report/residual_group.h"

#include <cmath>

#include "inference/scatter/scatter.h"
#include "server/report/comparison.h"
#include "server/report/scatter_record.h"

namespace calib::report {
namespace {

// Noise, correlated along the path of the control where a length is given.
Eigen::MatrixXd NoiseCovariance(const Eigen::VectorXd& sd, const Eigen::VectorXd& travelled,
                                double length) {
  Eigen::MatrixXd covariance = sd.cwiseAbs2().asDiagonal();
  for (Eigen::Index i = 0; length > 0 && i < sd.size(); ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      covariance(i, j) = covariance(j, i) =
          sd[i] * sd[j] * std::exp(-(travelled[i] - travelled[j]) / length);
    }
  }
  return covariance;
}

// The measured specimen is one packing of many; so is the model's where no mean over several runs
// can be given.
// in: travelled, of every reading of the experiment.
void AddScatter(const CampaignView& view, const std::vector<double>& travelled,
                ResidualGroup& group) {
  const v1::Posterior::Scatter* record =
      FindScatter(view.posterior, group.experiment->name, group.observable->name);
  if (record == nullptr) return;
  const inference::GroupScatter scatter =
      GroupScatterOf(*record, Eigen::Map<const Eigen::VectorXd>(
                                  travelled.data(), static_cast<Eigen::Index>(travelled.size())));
  std::vector<Eigen::Index> kept;
  for (const std::size_t i : group.readings) kept.push_back(static_cast<Eigen::Index>(i));
  const double times = scatter.share + (view.posterior.posterior_from() == "none" ? 1 : 0);
  const Eigen::MatrixXd covariance = times * inference::ScatterCovariance(scatter)(kept, kept);
  const Eigen::VectorXd ratio = covariance.diagonal().cwiseQuotient(group.covariance.diagonal());
  group.scatter = std::sqrt(ratio.mean());
  group.scatter_from = record->from();
  group.covariance += covariance;
}

}  // namespace

ResidualGroup MakeResidualGroup(const CampaignView& view, const campaign::Experiment& experiment,
                                std::size_t j, const ObservablePrediction& prediction) {
  ResidualGroup group{.experiment = &experiment,
                      .observable = &experiment.observables[j],
                      .readings = {},
                      .residual = {},
                      .covariance = {},
                      .model = {}};
  std::vector<double> residual;
  std::vector<double> sd;
  std::vector<double> travelled;
  std::vector<double> model;
  const std::vector<double> distance =
      campaign::TravelledControl(experiment, group.observable->correlation_length);
  for (std::size_t i = 0; i < experiment.control.size(); ++i) {
    if (!std::isfinite(prediction.mean[i])) continue;
    group.readings.push_back(i);
    residual.push_back(prediction.mean[i] - group.observable->values[i]);
    sd.push_back(ErrorOf(view, *group.observable, i));
    travelled.push_back(distance[i]);
    model.push_back(prediction.mean[i]);
  }
  const auto size = static_cast<Eigen::Index>(residual.size());
  group.residual = Eigen::Map<const Eigen::VectorXd>(residual.data(), size);
  const Eigen::Map<const Eigen::VectorXd> path(travelled.data(), size);
  if (group.observable->covariance.size() > 0) {
    std::vector<Eigen::Index> kept;
    for (const std::size_t i : group.readings) kept.push_back(static_cast<Eigen::Index>(i));
    group.covariance = Eigen::MatrixXd(group.observable->covariance(kept, kept));
  } else {
    group.covariance = NoiseCovariance(Eigen::Map<const Eigen::VectorXd>(sd.data(), size), path,
                                       group.observable->correlation_length);
  }
  if (size > 0) AddScatter(view, distance, group);
  group.model = Eigen::Map<const Eigen::VectorXd>(model.data(), size);
  return group;
}

}  // namespace calib::report
