#include "server/report/views/parameter_drift.h"

#include <algorithm>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>

#include "inference/emulator/emulated_posterior.h"
#include "server/report/views/run_table.h"
#include "server/report/views/setting_trend.h"

namespace calib::report {
namespace {

using Eigen::Index;

constexpr double kUninformed = 0.8;     // of the prior's sd: the part says nothing
constexpr double kTrendIsClear = 0.01;  // p below which a trend is stated
constexpr int kDraws = 500;

struct Part {
  int experiment = 0;
  std::string segment;
  std::vector<int> readings;  // ascending
};

std::vector<Part> PartsOf(const campaign::Campaign& campaign, const inference::DataSet& data) {
  std::vector<Part> experiments;
  std::vector<Part> segments;
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    const inference::Reading& reading = data.readings[k];
    const std::string& segment = campaign.experiments[static_cast<std::size_t>(reading.experiment)]
                                     .segment[static_cast<std::size_t>(reading.load_step)];
    const auto add = [&](std::vector<Part>& parts, const std::string& name) {
      auto at = std::find_if(parts.begin(), parts.end(), [&](const Part& p) {
        return p.experiment == reading.experiment && p.segment == name;
      });
      if (at == parts.end()) {
        at = parts.insert(parts.end(),
                          Part{.experiment = reading.experiment, .segment = name, .readings = {}});
      }
      at->readings.push_back(static_cast<int>(k));
    };
    add(experiments, "");
    add(segments, segment);
  }
  // An experiment of one stage is said once.
  std::erase_if(segments, [&segments](const Part& part) {
    return std::count_if(segments.begin(), segments.end(), [&part](const Part& other) {
             return other.experiment == part.experiment;
           }) == 1;
  });
  experiments.insert(experiments.end(), segments.begin(), segments.end());
  std::erase_if(experiments, [](const Part& part) {
    return part.readings.size() < static_cast<std::size_t>(kLeastReadings);
  });
  return experiments;
}

// One parameter of one part, in the standard coordinate of its prior (ln for logarithmic ones).
struct Estimate {
  std::size_t part = 0;
  double mean = 0, sd = 0;
};

struct Common {
  double mean = 0, sd = 0;
  std::optional<double> p_value;
};

Common CommonFit(const std::vector<Estimate>& estimates) {
  Common common;
  double weight = 0;
  for (const Estimate& e : estimates) {
    weight += 1 / (e.sd * e.sd);
    common.mean += e.mean / (e.sd * e.sd);
  }
  common.mean /= weight;
  common.sd = 1 / std::sqrt(weight);
  if (estimates.size() < 2) return common;
  double chi2 = 0;
  for (const Estimate& e : estimates) chi2 += std::pow((e.mean - common.mean) / e.sd, 2);
  common.p_value =
      boost::math::gamma_q(0.5 * static_cast<double>(estimates.size() - 1), 0.5 * chi2);
  return common;
}

// The clearest trend of the estimates with a setting.
void AddTrend(const campaign::Campaign& campaign, const std::vector<Part>& parts,
              const std::vector<Estimate>& estimates, double per_standard, ParameterDrift& drift) {
  std::vector<ValueInExperiment> values;
  for (const Estimate& e : estimates) {
    const auto experiment = static_cast<std::size_t>(parts[e.part].experiment);
    values.push_back(
        {.experiment = &campaign.experiments[experiment], .value = e.mean, .sd = e.sd});
  }
  const std::vector<SettingTrend> trends = TrendsWithSettings(values);
  const auto clearest = std::max_element(
      trends.begin(), trends.end(), [](const SettingTrend& a, const SettingTrend& b) {
        return std::abs(a.per_decade / a.sd) < std::abs(b.per_decade / b.sd);
      });
  if (clearest == trends.end()) return;
  drift.trend_with = clearest->with;
  drift.trend = clearest->per_decade * per_standard;
  drift.trend_sd = clearest->sd * per_standard;
}

}  // namespace

absl::StatusOr<std::vector<ParameterDrift>> ParameterDrifts(const CampaignView& view) {
  if (view.campaign.filter.noise != inference::NoiseMode::kGiven) {
    return absl::FailedPreconditionError(
        "parameters are not fitted part by part: the size of the errors was not stated");
  }
  const inference::DataSet data = campaign::MakeDataSet(view.campaign);
  const inference::JointPrior priors = campaign::Priors(view.campaign);
  const ScatteredReadings readings = ReadingsWithScatter(view);
  const RunTable runs = RunsOf(view);
  Eigen::MatrixXd predictions = runs.histories;
  for (Index k = 0; k < predictions.cols(); ++k) {
    const inference::Reading& reading = data.readings[static_cast<std::size_t>(k)];
    predictions.col(k) = (reading.value + reading.sd * predictions.col(k).array()).matrix();
  }
  const std::vector<Part> parts = PartsOf(view.campaign, data);
  const auto d = static_cast<Index>(priors.size());

  // [parameter] -> estimates, experiments and stages apart.
  std::vector<std::vector<Estimate>> experiments(priors.size());
  std::vector<std::vector<Estimate>> segments(priors.size());
  absl::Status first_problem;
  int emulated = 0;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const inference::DataSet own = inference::Restricted(readings.of_mean, parts[p].readings);
    inference::Iteration iteration;
    iteration.parameters = runs.parameters;
    iteration.predictions = predictions(Eigen::all, parts[p].readings);
    inference::EmulatorOptions options;
    options.draws = kDraws;
    options.seed = view.campaign.filter.seed;
    if (readings.measured) {
      options.training.scatter_share = 0;  // it is in the errors
      if (readings.departures.rows() > 0) {
        options.replicates = {
            .departures = readings.departures(Eigen::all, parts[p].readings),
            .scatter = inference::ErrorCovariance(own) -
                       inference::ErrorCovariance(inference::Restricted(data, parts[p].readings))};
      }
    }
    const std::vector<inference::Iteration> iterations = {iteration};
    const auto fit = inference::EmulatedPosterior(priors, own, options, iterations);
    if (!fit.ok()) {
      first_problem.Update(fit.status());
      continue;
    }
    ++emulated;
    if (!fit->adequate) continue;
    for (Index j = 0; j < d; ++j) {
      const inference::Prior& prior = priors[static_cast<std::size_t>(j)];
      const Eigen::ArrayXd values =
          fit->draws.col(j).unaryExpr([&prior](double x) { return prior.ToStandard(x); }).array();
      const double mean = values.mean();
      const double sd =
          std::sqrt((values - mean).square().sum() / static_cast<double>(values.size() - 1));
      if (!(sd > 0) || sd > kUninformed) continue;
      auto& list = parts[p].segment.empty() ? experiments : segments;
      list[static_cast<std::size_t>(j)].push_back({.part = p, .mean = mean, .sd = sd});
    }
  }

  if (emulated == 0 && !first_problem.ok()) return first_problem;

  std::vector<ParameterDrift> drifts;
  for (std::size_t j = 0; j < priors.size(); ++j) {
    const campaign::CalibratedParameter& parameter = view.campaign.parameters[j];
    ParameterDrift drift{.parameter = parameter.name,
                         .unit = parameter.unit,
                         .p_experiments = std::nullopt,
                         .p_segments = std::nullopt,
                         .trend_with = "",
                         .fits = {}};
    for (const auto* list : {&experiments[j], &segments[j]}) {
      if (list->empty()) continue;
      const Common common = CommonFit(*list);
      // d value / d standard coordinate at the common fit.
      const double center = priors[j].FromStandard(common.mean);
      const double per_standard = std::exp(-priors[j].LogJacobian(center));
      const bool whole = list == &experiments[j];
      (whole ? drift.p_experiments : drift.p_segments) = common.p_value;
      if (whole && common.p_value && *common.p_value < kTrendIsClear) {
        AddTrend(view.campaign, parts, *list, per_standard, drift);
      }
      for (const Estimate& e : *list) {
        const double value = priors[j].FromStandard(e.mean);
        // The common fit holds the part itself, which shortens the distance between the two.
        const double variance = e.sd * e.sd - common.sd * common.sd;
        drift.fits.push_back(
            {.experiment =
                 view.campaign.experiments[static_cast<std::size_t>(parts[e.part].experiment)].name,
             .segment = parts[e.part].segment,
             .mean = value,
             .sd = e.sd * std::exp(-priors[j].LogJacobian(value)),
             .z = list->size() > 1 && variance > 0 ? (e.mean - common.mean) / std::sqrt(variance)
                                                   : 0});
      }
    }
    drifts.push_back(std::move(drift));
  }
  return drifts;
}

}  // namespace calib::report
