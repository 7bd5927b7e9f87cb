#include "server/report/views/residual_group.h"

#include <algorithm>
#include <cmath>

#include "inference/scatter/scatter.h"
#include "server/messages/read_words.h"
#include "server/report/views/comparison.h"
#include "server/report/views/scatter_record.h"

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
// out: covariance of a single run by packings; empty: not known.
Eigen::MatrixXd AddScatter(const CampaignView& view, const std::vector<double>& travelled,
                           ResidualGroup& group) {
  const v1::Posterior::Scatter* record =
      FindScatter(view.posterior, group.experiment->name, group.observable->name);
  if (record == nullptr) return {};
  const inference::GroupScatter scatter =
      GroupScatterOf(*record, Eigen::Map<const Eigen::VectorXd>(
                                  travelled.data(), static_cast<Eigen::Index>(travelled.size())));
  std::vector<Eigen::Index> kept;
  kept.reserve(group.readings.size());
  for (const std::size_t i : group.readings) kept.push_back(static_cast<Eigen::Index>(i));
  const double times =
      scatter.share +
      (messages::SourceOf(view.posterior) == campaign::PosteriorSource::kNone ? 1 : 0);
  Eigen::MatrixXd of_run = inference::ScatterCovariance(scatter)(kept, kept);
  const Eigen::MatrixXd covariance = times * of_run;
  const Eigen::VectorXd ratio = covariance.diagonal().cwiseQuotient(group.covariance.diagonal());
  group.scatter = std::sqrt(ratio.mean());
  group.scatter_from = record->from();
  group.covariance += covariance;
  const auto source = messages::SourceOf(*record);
  if (source != campaign::ScatterSource::kEmulator) {
    group.of_scatter = of_run;
    group.scatter_runs = record->runs();
    group.twins = source == campaign::ScatterSource::kRepeats;
  }
  return of_run;
}

// Runs at draws of the posterior differ by their parameters and by their packings; the mean has the
// first as a whole, and of both what so many runs leave.
Eigen::MatrixXd OfPrediction(const ObservablePrediction& prediction,
                             const std::vector<Eigen::Index>& rows,
                             const Eigen::MatrixXd& by_packings) {
  const Eigen::MatrixXd of_runs = prediction.of_runs(rows, rows);
  const double all = of_runs.trace();
  const double packings = by_packings.size() > 0 ? by_packings.trace() : 0;
  const double by_parameters = all > 0 ? std::max(0.0, all - packings) / all : 0;
  return (by_parameters + 1 / prediction.runs) * of_runs;
}

}  // namespace

ResidualGroup MakeResidualGroup(const CampaignView& view, const campaign::Experiment& experiment,
                                std::size_t j, const ObservablePrediction& prediction) {
  ResidualGroup group{.experiment = &experiment,
                      .observable = &experiment.observables[j],
                      .readings = {},
                      .residual = {},
                      .covariance = {},
                      .of_prediction = {},
                      .model = {}};
  std::vector<double> residual;
  std::vector<double> sd;
  std::vector<double> travelled;
  std::vector<double> model;
  const std::vector<double> distance =
      campaign::TravelledControl(experiment, group.observable->correlation_length);
  for (std::size_t i = 0; i < experiment.control.size(); ++i) {
    if (!std::isfinite(prediction.mean[i]) || std::isnan(group.observable->values[i])) continue;
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
    kept.reserve(group.readings.size());
    for (const std::size_t i : group.readings) kept.push_back(static_cast<Eigen::Index>(i));
    group.covariance = Eigen::MatrixXd(group.observable->covariance(kept, kept));
  } else {
    group.covariance = NoiseCovariance(Eigen::Map<const Eigen::VectorXd>(sd.data(), size), path,
                                       group.observable->correlation_length);
  }
  group.of_prediction = Eigen::MatrixXd::Zero(size, size);
  const Eigen::MatrixXd of_specimen =
      size > 0 ? AddScatter(view, distance, group) : Eigen::MatrixXd();
  if (experiment.role == campaign::Role::kValidate && prediction.of_runs.size() > 0 &&
      group.readings.size() == campaign::ReadingsOf(*group.observable)) {
    group.of_prediction =
        OfPrediction(prediction, campaign::RowsRead(*group.observable), of_specimen);
  }
  group.model = Eigen::Map<const Eigen::VectorXd>(model.data(), size);
  return group;
}

}  // namespace calib::report
