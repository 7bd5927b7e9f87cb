#include "server/report/views/comparison.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "inference/numerics/decompositions.h"
#include "inference/scatter/chi_squared_law.h"
#include "server/campaign/checks/noise_check.h"
#include "server/messages/read_words.h"
#include "server/report/views/residual_group.h"
#include "server/report/views/setting_trend.h"

namespace calib::report {
namespace {

using Group = ResidualGroup;

ResidualCurve CurveOf(const Group& group, Eigen::Index first, Eigen::Index count) {
  const Eigen::VectorXd sd = group.covariance.diagonal().cwiseSqrt();
  ResidualCurve curve{.residual = group.residual.segment(first, count),
                      .sd = sd.segment(first, count),
                      .correlation = Eigen::VectorXd::Zero(count),
                      .control = Eigen::VectorXd(count),
                      .model = group.model.segment(first, count)};
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::Index at = first + i;
    if (i > 0) curve.correlation[i] = group.covariance(at, at - 1) / (sd[at] * sd[at - 1]);
    curve.control[i] = group.experiment->control[group.readings[static_cast<std::size_t>(at)]];
  }
  return curve;
}

// r^T Sigma^-1 r of readings first .. first + count - 1.
double ChiSquared(const Eigen::MatrixXd& covariance, const Eigen::VectorXd& residual,
                  Eigen::Index first, Eigen::Index count) {
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance.block(first, first, count, count));
  return factor.matrixL().solve(residual.segment(first, count)).squaredNorm();
}

// n^2 / sum of the correlations of the errors of readings first .. first + count - 1.
double EffectiveReadings(const Group& group, Eigen::Index first, Eigen::Index count) {
  const Eigen::MatrixXd covariance = group.covariance.block(first, first, count, count);
  const Eigen::VectorXd inverse = covariance.diagonal().cwiseSqrt().cwiseInverse();
  const auto n = static_cast<double>(count);
  return n * n / inverse.dot(covariance * inverse);
}

// Covariance of the residuals if the model is right, and the part of it that packings or twins
// show.
struct Expected {
  Eigen::MatrixXd covariance;
  Eigen::MatrixXd scatter;  // zero where neither were run
};

// A mean over R packings is off by 1/R of their scatter, one over samples of which each is a twin
// of its own by next to nothing; of held-out data the prediction has it.
Expected ExpectedOf(const Group& group, const CampaignView& view, bool validation) {
  Expected expected{.covariance = group.covariance + group.of_prediction,
                    .scatter = Eigen::MatrixXd::Zero(group.residual.size(), group.residual.size())};
  if (group.scatter_runs < 2) return expected;
  const bool mean = messages::SourceOf(view.posterior) != campaign::PosteriorSource::kNone;
  const double of_mean = group.twins ? 0 : 1.0 / group.scatter_runs;
  const double of_model = mean ? of_mean : 1;
  const double share = campaign::ScatterShare(*group.experiment);
  const bool predicted = mean && validation;
  expected.scatter = (share + (predicted ? 0 : of_model)) * group.of_scatter;
  if (mean && !validation) expected.covariance += of_model * group.of_scatter;
  return expected;
}

// What the record says of these readings at draws of the posterior.
std::optional<double> PredictiveP(const CampaignView& view, const Group& group, Eigen::Index first,
                                  Eigen::Index count) {
  const auto step = [&group](Eigen::Index i) {
    return static_cast<int>(group.readings[static_cast<std::size_t>(i)]);
  };
  for (const v1::Posterior::StageP& stage : view.posterior.stage_p()) {
    if (stage.experiment() == group.experiment->name &&
        stage.observable() == group.observable->name && stage.first() == step(first) &&
        stage.last() == step(first + count - 1)) {
      return stage.p();
    }
  }
  return std::nullopt;
}

void AddSegments(const CampaignView& view, const Group& group, const Expected& expected,
                 bool heldout, bool judged, std::vector<SegmentMisfit>& out) {
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
        .z = std::nullopt,
        .p_value = std::nullopt,
        .readings = static_cast<int>(count),
        .effective_readings = EffectiveReadings(group, first, count),
        .rms_error = std::sqrt(
            group.residual.segment(first, count)
                .cwiseQuotient(group.covariance.diagonal().segment(first, count).cwiseSqrt())
                .squaredNorm() /
            static_cast<double>(count)),
        .chi2_share = std::nullopt};
    if (judged) {
      const Eigen::MatrixXd own = expected.covariance.block(first, first, count, count);
      const Eigen::MatrixXd scatter = expected.scatter.block(first, first, count, count);
      const auto n = static_cast<double>(count);
      misfit.z = inference::NormalDeviateOfMean(misfit.bias * n / std::sqrt(own.sum()),
                                                scatter.sum() / own.sum(), group.scatter_runs);
      misfit.predictive_p = PredictiveP(view, group, first, count);
      misfit.p_value = misfit.predictive_p.value_or(
          inference::UpperTail(ChiSquared(expected.covariance, group.residual, first, count), n,
                               inference::WhatIsKnown(own, scatter, group.scatter_runs)));
      // Divided by their sum in the end.
      misfit.chi2_share = ChiSquared(group.covariance, group.residual, first, count);
      misfit.pattern = PatternOf(CurveOf(group, first, count));
    }
    out.push_back(std::move(misfit));
    first = end;
  }
}

void ToShares(std::vector<SegmentMisfit>& segments) {
  double fitted = 0;
  double heldout = 0;
  for (const SegmentMisfit& m : segments)
    (m.heldout ? heldout : fitted) += m.chi2_share.value_or(0);
  for (SegmentMisfit& m : segments) {
    const double sum = m.heldout ? heldout : fitted;
    if (m.chi2_share && sum > 0) *m.chi2_share /= sum;
  }
}

// Where the bias of a stage goes with what differs between the experiments.
std::vector<BiasTrend> TrendsOf(const campaign::Campaign& campaign,
                                const std::vector<SegmentMisfit>& segments) {
  std::map<std::pair<std::string, std::string>, std::vector<ValueInExperiment>> stages;
  for (const SegmentMisfit& m : segments) {
    if (m.heldout || !m.z || *m.z == 0) continue;
    const auto experiment =
        std::find_if(campaign.experiments.begin(), campaign.experiments.end(),
                     [&m](const campaign::Experiment& e) { return e.name == m.experiment; });
    stages[{m.observable, m.segment}].push_back(
        {.experiment = &*experiment, .value = m.bias, .sd = m.bias / *m.z});
  }
  std::vector<BiasTrend> trends;
  for (const auto& [stage, biases] : stages) {
    for (const SettingTrend& trend : TrendsWithSettings(biases)) {
      const double z = trend.per_decade / trend.sd;
      if (std::abs(z) < kClear) continue;
      trends.push_back({.observable = stage.first,
                        .segment = stage.second,
                        .with = trend.with,
                        .per_decade = trend.per_decade,
                        .z = z});
    }
  }
  return trends;
}

struct Sums {
  double squared = 0;  // of residual / sd
  double chi2 = 0;
  int readings = 0;
  inference::KnownFrom known{};
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
      const Group group = MakeResidualGroup(view, experiment, j, predictions[e].observables[j]);
      const auto n = static_cast<double>(group.readings.size());
      if (group.readings.empty()) continue;
      const double squared =
          group.residual.cwiseAbs2().cwiseQuotient(group.covariance.diagonal()).sum();
      ObservableMisfit misfit{
          .experiment = experiment.name,
          .observable = group.observable->name,
          .heldout = validation,
          .readings = static_cast<int>(group.readings.size()),
          .rms_error = std::sqrt(squared / n),
          .rms_residual = std::sqrt(group.residual.squaredNorm() / n),
          .scatter = group.scatter,
          .scatter_from = group.scatter_from,
          .z = std::nullopt,
          .p_value = std::nullopt,
          .effective_readings = EffectiveReadings(group, 0, group.residual.size())};
      const Expected expected = ExpectedOf(group, view, validation);
      Sums& sums = validation ? heldout : fitted;
      sums.squared += squared;
      sums.readings += misfit.readings;
      if (judged) {
        const double chi2 =
            ChiSquared(expected.covariance, group.residual, 0, group.residual.size());
        const inference::KnownFrom known =
            inference::WhatIsKnown(expected.covariance, expected.scatter, group.scatter_runs);
        misfit.pattern = PatternOf(CurveOf(group, 0, group.residual.size()));
        misfit.z = inference::NormalDeviate(chi2, n, known);
        misfit.predictive_p = PredictiveP(view, group, 0, group.residual.size());
        misfit.p_value = misfit.predictive_p.value_or(inference::UpperTail(chi2, n, known));
        sums.chi2 += chi2;
        sums.known += known;
      }
      comparison.by_observable.push_back(std::move(misfit));
      AddSegments(view, group, expected, validation, judged, comparison.by_segment);
    }
  }
  comparison.rms_error = std::sqrt(fitted.squared / fitted.readings);
  if (heldout.readings > 0) {
    comparison.heldout_rms_error = std::sqrt(heldout.squared / heldout.readings);
  }
  const int degrees = fitted.readings - campaign::FreeParameters(view.campaign);
  if (judged && degrees > 0) {
    comparison.reduced_chi2 = fitted.chi2 / degrees;
    comparison.p_value = inference::UpperTail(fitted.chi2, degrees, fitted.known);
  } else if (!judged) {
    comparison.note =
        "The size of the errors was not stated independently (noise is inferred, tempered to an "
        "effective sample size, or beside a model error that explains every misfit), so nothing is "
        "said about whether the model is adequate.";
  } else {
    comparison.note =
        "There are fewer readings than parameters: nothing is left to judge the fit by.";
  }
  if (judged && view.posterior.has_predictive_p()) {
    comparison.predictive_p = view.posterior.predictive_p();
  }
  comparison.warnings = campaign::Sentences(campaign::NoiseWarnings(view.campaign));
  ToShares(comparison.by_segment);
  comparison.trends = TrendsOf(view.campaign, comparison.by_segment);
  for (const auto& parameter : view.posterior.parameters()) {
    if (parameter.at_bound()) comparison.at_bound.push_back(parameter.name());
  }
  return comparison;
}

}  // namespace calib::report
