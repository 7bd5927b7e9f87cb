#include "server/report/comparison.h"

#include <boost/math/special_functions/gamma.hpp>
#include <cmath>

namespace calib::report {
namespace {

// Residuals of one observable of one experiment at the readings that the prediction covers.
struct Group {
  const campaign::Experiment* experiment = nullptr;
  const campaign::MeasuredObservable* observable = nullptr;
  std::vector<std::size_t> readings;
  Eigen::VectorXd residual;  // model - measurement
  Eigen::VectorXd sd;
  Eigen::VectorXd travelled;  // path length of the control
};

Group MakeGroup(const CampaignView& view, const campaign::Experiment& experiment, std::size_t j,
                const ObservablePrediction& prediction) {
  Group group{.experiment = &experiment,
              .observable = &experiment.observables[j],
              .readings = {},
              .residual = {},
              .sd = {},
              .travelled = {}};
  std::vector<double> residual;
  std::vector<double> sd;
  std::vector<double> travelled;
  const std::vector<double> distance =
      campaign::TravelledControl(experiment, group.observable->correlation_length);
  for (std::size_t i = 0; i < experiment.control.size(); ++i) {
    if (!std::isfinite(prediction.mean[i])) continue;
    group.readings.push_back(i);
    residual.push_back(prediction.mean[i] - group.observable->values[i]);
    sd.push_back(ErrorOf(view, *group.observable, i));
    travelled.push_back(distance[i]);
  }
  const auto size = static_cast<Eigen::Index>(residual.size());
  group.residual = Eigen::Map<const Eigen::VectorXd>(residual.data(), size);
  group.sd = Eigen::Map<const Eigen::VectorXd>(sd.data(), size);
  group.travelled = Eigen::Map<const Eigen::VectorXd>(travelled.data(), size);
  return group;
}

// Correlation of the errors of readings i - 1 and i. exp(-distance / length) along one path is a
// Markov chain, so that neighbours are all that chi-squared and the variance of a mean need.
double NeighbourCorrelation(const Group& group, Eigen::Index i) {
  const double length = group.observable->correlation_length;
  return length > 0 ? std::exp(-(group.travelled[i] - group.travelled[i - 1]) / length) : 0;
}

// r^T Sigma^-1 r with Sigma_ij = sd_i sd_j exp(-|c_i - c_j| / length).
double ChiSquared(const Group& group) {
  const Eigen::VectorXd u = group.residual.cwiseQuotient(group.sd);
  double chi2 = u[0] * u[0];
  for (Eigen::Index i = 1; i < u.size(); ++i) {
    const double rho = NeighbourCorrelation(group, i);
    const double innovation = u[i] - rho * u[i - 1];
    chi2 += innovation * innovation / (1 - rho * rho);
  }
  return chi2;
}

// Variance of the mean error of readings first .. first + count - 1: the sum of Sigma over count^2.
double VarianceOfMean(const Group& group, Eigen::Index first, Eigen::Index count) {
  double sum = 0;
  double earlier = 0;  // sum over k < i of sd_k correlation(k, i)
  for (Eigen::Index i = first; i < first + count; ++i) {
    if (i > first) earlier = (earlier + group.sd[i - 1]) * NeighbourCorrelation(group, i);
    sum += group.sd[i] * (group.sd[i] + 2 * earlier);
  }
  return sum / static_cast<double>(count * count);
}

double UpperTail(double chi2, double degrees) {
  return boost::math::gamma_q(0.5 * degrees, 0.5 * chi2);
}

// Cube root of chi-squared over its degrees of freedom is nearly normal [Wilson & Hilferty 1931].
double NormalDeviate(double chi2, double degrees) {
  const double spread = 2 / (9 * degrees);
  return (std::cbrt(chi2 / degrees) - (1 - spread)) / std::sqrt(spread);
}

void AddSegments(const Group& group, bool heldout, bool judged, std::vector<SegmentMisfit>& out) {
  const auto size = static_cast<Eigen::Index>(group.readings.size());
  const auto segment = [&group](Eigen::Index i) -> const std::string& {
    return group.experiment->segment[group.readings[static_cast<std::size_t>(i)]];
  };
  for (Eigen::Index first = 0; first < size;) {
    Eigen::Index end = first + 1;
    while (end < size && segment(end) == segment(first)) ++end;
    const Eigen::Index count = end - first;
    SegmentMisfit misfit{
        .experiment = group.experiment->name,
        .observable = group.observable->name,
        .segment = segment(first),
        .heldout = heldout,
        .from = group.experiment->control[group.readings[static_cast<std::size_t>(first)]],
        .to = group.experiment->control[group.readings[static_cast<std::size_t>(end - 1)]],
        .bias = group.residual.segment(first, count).mean(),
        .z = std::nullopt};
    if (judged) {
      misfit.z = misfit.bias / std::sqrt(VarianceOfMean(group, first, count));
    }
    out.push_back(std::move(misfit));
    first = end;
  }
}

std::vector<ParameterDrift> Drifts(const v1::Posterior& posterior) {
  std::vector<ParameterDrift> drifts;
  if (posterior.path_size() < 2) return drifts;
  const auto& half = posterior.path(posterior.path_size() / 2 - 1);
  const auto& end = posterior.path(posterior.path_size() - 1);
  for (int k = 0; k < posterior.parameters_size() && k < half.mean_size() && k < end.mean_size();
       ++k) {
    const double sd = posterior.parameters(k).sd();
    drifts.push_back({.parameter = posterior.parameters(k).name(),
                      .half_way = half.mean(k),
                      .end = end.mean(k),
                      .change_over_sd = sd > 0 ? (end.mean(k) - half.mean(k)) / sd : std::nan("")});
  }
  return drifts;
}

struct Sums {
  double squared = 0;  // of residual / sd
  double chi2 = 0;
  int readings = 0;
};

}  // namespace

double ErrorOf(const CampaignView& view, const campaign::MeasuredObservable& observable,
               std::size_t reading) {
  if (!observable.sd.empty()) return observable.sd[reading];
  if (!view.posterior.has_sigma()) return std::nan("");
  return std::sqrt(view.posterior.sigma() * observable.ess_weight) *
         std::abs(observable.values[reading]);
}

Comparison Compare(const CampaignView& view, const std::vector<ExperimentPrediction>& predictions) {
  const bool judged = view.campaign.filter.noise == inference::NoiseMode::kGiven;
  Comparison comparison;
  Sums fitted;
  Sums heldout;
  for (std::size_t e = 0; e < view.campaign.experiments.size(); ++e) {
    const campaign::Experiment& experiment = view.campaign.experiments[e];
    const bool validation = experiment.role == campaign::Role::kValidate;
    for (std::size_t j = 0; j < experiment.observables.size(); ++j) {
      const Group group = MakeGroup(view, experiment, j, predictions[e].observables[j]);
      const auto n = static_cast<double>(group.readings.size());
      if (group.readings.empty()) continue;
      const double squared = group.residual.cwiseQuotient(group.sd).squaredNorm();
      ObservableMisfit misfit{.experiment = experiment.name,
                              .observable = group.observable->name,
                              .heldout = validation,
                              .readings = static_cast<int>(group.readings.size()),
                              .rms_error = std::sqrt(squared / n),
                              .rms_residual = std::sqrt(group.residual.squaredNorm() / n),
                              .z = std::nullopt,
                              .p_value = std::nullopt};
      Sums& sums = validation ? heldout : fitted;
      sums.squared += squared;
      sums.readings += misfit.readings;
      if (judged) {
        const double chi2 = ChiSquared(group);
        misfit.z = NormalDeviate(chi2, n);
        misfit.p_value = UpperTail(chi2, n);
        sums.chi2 += chi2;
      }
      comparison.by_observable.push_back(std::move(misfit));
      AddSegments(group, validation, judged, comparison.by_segment);
    }
  }
  comparison.rms_error = std::sqrt(fitted.squared / fitted.readings);
  if (heldout.readings > 0) {
    comparison.heldout_rms_error = std::sqrt(heldout.squared / heldout.readings);
  }
  const int degrees = fitted.readings - static_cast<int>(view.campaign.parameters.size());
  if (judged && degrees > 0) {
    comparison.reduced_chi2 = fitted.chi2 / degrees;
    comparison.p_value = UpperTail(fitted.chi2, degrees);
  } else if (!judged) {
    comparison.note =
        "The size of the errors was not stated independently (noise is inferred or tempered to an "
        "effective sample size), so "
        "nothing is said about whether the model is adequate.";
  } else {
    comparison.note =
        "There are fewer readings than parameters: nothing is left to judge the fit by.";
  }
  comparison.parameter_drift = Drifts(view.posterior);
  return comparison;
}

}  // namespace calib::report
