#include "server/report/views/sensitivity.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/registry/catalog.h"
#include "inference/sampling/philox.h"
#include "server/messages/read_words.h"
#include "server/report/views/bulk_properties.h"
#include "server/report/views/warnings.h"

namespace calib::report {
namespace {

using campaign::PosteriorSource;
using Eigen::Index;

constexpr int kPriorDraws = 1000;
constexpr int kPosteriorDraws = 400;

std::string UnitOf(const std::string& observable) {
  const dem::ObservableInfo* info = dem::FindObservable(observable);
  return info == nullptr ? "1" : info->unit;
}

// Outputs of one run, by name; every run of an experiment has the same names.
std::vector<BulkProperty> OutputsOf(const campaign::Experiment& experiment,
                                    const StateHistory& history) {
  std::vector<BulkProperty> outputs = BulkProperties(experiment, history);
  const auto last = std::max_element(
      history.states.begin(), history.states.end(),
      [](const v1::State& a, const v1::State& b) { return a.load_step() < b.load_step(); });
  for (const campaign::MeasuredObservable& observable : experiment.observables) {
    const auto at =
        std::find(history.observables.begin(), history.observables.end(), observable.name);
    const auto index = static_cast<int>(at - history.observables.begin());
    const bool there = at != history.observables.end() && last != history.states.end() &&
                       index < last->values_size();
    outputs.push_back({"final_" + observable.name, UnitOf(observable.name),
                       there ? last->values(index) : std::nan("")});
  }
  return outputs;
}

bool IsComplete(const campaign::Experiment& experiment, const StateHistory& history) {
  return history.states.size() >= experiment.control.size();
}

// Equally weighted points of the posterior, 0 rows where there is none.
Eigen::MatrixXd PosteriorPoints(const CampaignView& view) {
  const v1::Posterior& posterior = view.posterior;
  const auto d = static_cast<Index>(view.campaign.parameters.size());
  if (messages::SourceOf(posterior) == PosteriorSource::kNone ||
      posterior.posterior_from().empty()) {
    return Eigen::MatrixXd(0, d);
  }
  if (posterior.draws_size() > 0 && posterior.draws_size() % d == 0) {
    const Index n = posterior.draws_size() / d;
    Eigen::MatrixXd points(n, d);
    for (Index i = 0; i < n; ++i) {
      for (Index j = 0; j < d; ++j) points(i, j) = posterior.draws(static_cast<int>(i * d + j));
    }
    return points;
  }
  // Systematic resampling of the weighted samples.
  Eigen::MatrixXd points(kPosteriorDraws, d);
  double passed = 0;
  Index filled = 0;
  for (const v1::Sample& sample : view.samples) {
    if (!std::isfinite(sample.weight()) || sample.parameters_size() != d) continue;
    passed += sample.weight();
    while (filled < kPosteriorDraws &&
           (static_cast<double>(filled) + 0.5) / kPosteriorDraws <= passed) {
      for (Index j = 0; j < d; ++j) points(filled, j) = sample.parameters(static_cast<int>(j));
      ++filled;
    }
  }
  return points.topRows(filled);
}

// Why none of the complete runs has an output.
std::string WhyNone(const campaign::Experiment& experiment, const StateHistory& history,
                    const std::string& name) {
  constexpr std::string_view kFinal = "final_";
  const bool is_final = name.rfind(kFinal, 0) == 0;
  return is_final ? absl::StrCat("no run gives ", name.substr(kFinal.size()))
                  : WhyNoBulkProperty(experiment, history, name);
}

struct Column {
  std::vector<int> samples;  // positions in view.samples
  std::vector<double> values;
};

}  // namespace

absl::StatusOr<Sensitivity> AnalyseCampaign(const CampaignView& view) {
  const inference::JointPrior priors = campaign::Priors(view.campaign);
  const auto d = static_cast<Index>(priors.size());
  Sensitivity result;
  for (const campaign::CalibratedParameter& parameter : view.campaign.parameters) {
    result.parameters.push_back(parameter.name);
  }
  result.independent = priors.is_independent() && !priors.is_constrained();
  Eigen::MatrixXd prior_points(kPriorDraws, d);
  for (Index i = 0; i < kPriorDraws; ++i) {
    inference::PhiloxStream stream({.seed = view.campaign.seed,
                                    .purpose = inference::StreamPurpose::kSensitivity,
                                    .sample = static_cast<std::uint64_t>(i)});
    prior_points.row(i) = priors.Draw(stream);
  }
  const Eigen::MatrixXd posterior_points = PosteriorPoints(view);
  if (posterior_points.rows() > 2) {
    result.points_from = messages::SourceOf(view.posterior).value_or(PosteriorSource::kNone);
  }
  const inference::SensitivityOptions options{.sobol = {.seed = view.campaign.seed % 1000}};
  const std::vector<Eigen::MatrixXd> sets =
      result.independent ? inference::SobolSets(static_cast<int>(d), options.sobol)
                         : std::vector<Eigen::MatrixXd>();
  const inference::RankedPoints over_prior = inference::Ranked(priors, prior_points);
  const inference::RankedPoints over_posterior = inference::Ranked(priors, posterior_points);

  absl::Status last = absl::FailedPreconditionError(
      "there are no finished runs, so that nothing can be said of what moves them");
  for (const campaign::Experiment& experiment : view.campaign.experiments) {
    std::vector<BulkProperty> names;
    std::vector<Column> columns;
    const StateHistory* complete = nullptr;  // the first
    for (std::size_t i = 0; i < view.samples.size(); ++i) {
      const auto found = view.states.find({experiment.name, view.samples[i].index()});
      if (found == view.states.end() || !IsComplete(experiment, found->second)) continue;
      const std::vector<BulkProperty> outputs = OutputsOf(experiment, found->second);
      if (names.empty()) {
        names = outputs;
        columns.resize(outputs.size());
        complete = &found->second;
      }
      for (std::size_t k = 0; k < outputs.size(); ++k) {
        if (!std::isfinite(outputs[k].value)) continue;
        columns[k].samples.push_back(static_cast<int>(i));
        columns[k].values.push_back(outputs[k].value);
      }
    }
    for (std::size_t k = 0; k < names.size(); ++k) {
      const auto n = static_cast<Index>(columns[k].values.size());
      if (n == 0) {
        result.left_out.push_back(absl::StrCat(experiment.name, ": ", names[k].name, ": ",
                                               WhyNone(experiment, *complete, names[k].name)));
        last = absl::FailedPreconditionError(result.left_out.back());
        continue;
      }
      Eigen::MatrixXd parameters(n, d);
      Eigen::VectorXd outputs(n);
      for (Index i = 0; i < n; ++i) {
        const v1::Sample& sample =
            view.samples[static_cast<std::size_t>(columns[k].samples[static_cast<std::size_t>(i)])];
        for (Index j = 0; j < d; ++j) parameters(i, j) = sample.parameters(static_cast<int>(j));
        outputs[i] = columns[k].values[static_cast<std::size_t>(i)];
      }
      const auto emulated = inference::EmulatedOutput::Fit(priors, parameters, outputs, options);
      if (!emulated.ok()) {
        last = emulated.status();
        result.left_out.push_back(
            absl::StrCat(experiment.name, ": ", names[k].name, ": ", std::string(last.message())));
        continue;
      }
      Quantity& quantity = result.quantities.emplace_back();
      quantity.experiment = experiment.name;
      quantity.name = names[k].name;
      quantity.unit = names[k].unit;
      quantity.runs = static_cast<int>(n);
      quantity.prior = emulated->Over(priors, over_prior, sets);
      if (result.points_from == PosteriorSource::kNone || !quantity.prior.Explains()) continue;
      quantity.posterior = emulated->Over(priors, over_posterior, {});
    }
  }
  if (result.quantities.empty()) return last;
  result.warnings = Warnings(view);
  return result;
}

}  // namespace calib::report
