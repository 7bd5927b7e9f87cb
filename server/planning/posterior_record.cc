#include "server/planning/posterior_record.h"

#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "inference/filter/parameter_summary.h"
#include "server/planning/json_vectors.h"
#include "server/planning/stage_misfit.h"

namespace calib::planning {
namespace {

constexpr double kTail = 1e-3;  // shown as the range of an unbounded prior
constexpr Eigen::Index kDraws = 400;

void SetSummary(const inference::ParameterSummary& summary, v1::Posterior::Parameter& out) {
  out.set_mean(summary.mean);
  out.set_sd(summary.sd);
  out.set_cov(summary.cov);
  out.set_q05(summary.q05);
  out.set_q50(summary.q50);
  out.set_q95(summary.q95);
}

void AddParameters(const Definition& definition, const Answer& answer, v1::Posterior& message) {
  const std::vector<inference::ParameterSummary> summaries = answer.Parameters();
  for (std::size_t i = 0; i < summaries.size(); ++i) {
    const inference::ParameterSummary& summary = summaries[i];
    const campaign::CalibratedParameter& parameter = definition.campaign.parameters[i];
    const inference::Prior& prior = parameter.prior;
    v1::Posterior::Parameter& out = *message.add_parameters();
    out.set_name(parameter.name);
    out.set_unit(parameter.unit);
    SetSummary(summary, out);
    out.set_at_bound(summary.at_bound);
    out.set_nuisance(parameter.nuisance);
    const auto& frozen = answer.weighted.frozen;
    out.set_conditioned_on(!frozen.empty() && frozen[i].has_value());
    const Eigen::VectorXd& halves =
        answer.FromEmulator() ? answer.emulated->split_half : answer.weighted.split_half;
    out.set_split_half(answer.HasIntervals() && halves.size() > 0
                           ? halves[static_cast<Eigen::Index>(i)]
                           : std::numeric_limits<double>::quiet_NaN());
    out.set_prior_min(std::isfinite(prior.min) ? prior.min : prior.Quantile(kTail));
    out.set_prior_max(std::isfinite(prior.max) ? prior.max : prior.Quantile(1 - kTail));
  }
}

void AddMembers(const campaign::Campaign& campaign, const Answer& answer, v1::Posterior& message) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const std::vector<inference::ParameterSummary> summaries = answer.Members(campaign);
  auto summary = summaries.begin();
  for (const campaign::Population& population : campaign.populations) {
    for (const std::string& label : population.labels) {
      v1::Posterior::Parameter& out = *message.add_members();
      out.set_name(campaign::MemberName(population.name, label));
      out.set_unit(population.unit);
      SetSummary(*summary++, out);
      out.set_nuisance(campaign.parameters[population.common].nuisance);
      out.set_split_half(kNone);
      out.set_prior_min(kNone);
      out.set_prior_max(kNone);
    }
  }
}

// Parameters that the data push out where their prior has no bound.
void AddTails(const Definition& definition, const Answer& answer, v1::Posterior& message) {
  const std::vector<inference::ParameterSummary> summaries = answer.Parameters();
  for (std::size_t i = 0; answer.HasIntervals() && i < summaries.size(); ++i) {
    const campaign::CalibratedParameter& parameter = definition.campaign.parameters[i];
    if (!inference::InTail(parameter.prior, summaries[i])) continue;
    message.add_warnings(absl::StrCat(
        parameter.name,
        " lies in the tail of its prior, which has no bound there: prior and data disagree. Widen "
        "the prior if it was a guess, or look for a missing effect."));
  }
}

void AddPath(const Definition& definition, const inference::PosteriorPath& path,
             google::protobuf::RepeatedPtrField<v1::Posterior::PathPoint>& points) {
  for (std::size_t s = 0; s < path.load_step.size(); ++s) {
    const auto row = static_cast<Eigen::Index>(s);
    v1::Posterior::PathPoint& point = *points.Add();
    point.set_experiment(
        definition.campaign.experiments[static_cast<std::size_t>(path.experiment[s])].name);
    point.set_load_step(path.load_step[s]);
    for (Eigen::Index j = 0; j < path.mean.cols(); ++j) {
      point.add_mean(path.mean(row, j));
      point.add_cov(path.cov(row, j));
    }
    point.set_ess(path.ess(row));
  }
}

// EXPERIMENT.OBSERVABLE of each member, appended.
void AddNames(const Definition& definition, const std::vector<std::pair<int, int>>& members,
              google::protobuf::RepeatedPtrField<std::string>& names) {
  for (const auto& [e, j] : members) {
    const auto& experiment = definition.campaign.experiments[static_cast<std::size_t>(e)];
    *names.Add() = absl::StrCat(experiment.name, ".",
                                experiment.observables[static_cast<std::size_t>(j)].name);
  }
}

void AddNoiseScale(const Definition& definition, const Eigen::MatrixXd& scale,
                   v1::Posterior& message) {
  const auto groups = inference::NoiseGroupsOf(definition.data);
  if (scale.rows() != static_cast<Eigen::Index>(groups.size())) {
    return;  // not inferred
  }
  for (std::size_t g = 0; g < groups.size(); ++g) {
    v1::Posterior::NoiseScale& out = *message.add_noise_scale();
    AddNames(definition, groups[g].members, *out.mutable_observables());
    const auto row = static_cast<Eigen::Index>(g);
    out.set_q05(scale(row, 0));
    out.set_q50(scale(row, 1));
    out.set_q95(scale(row, 2));
  }
}

void AddSize(const inference::ErrorScaleSummary& size, v1::Posterior::ModelError::Size& out) {
  out.set_mean(size.mean);
  out.set_sd(size.sd);
  out.set_q05(size.q05);
  out.set_q50(size.q50);
  out.set_q95(size.q95);
  out.set_mean_square(size.mean_square);
}

void AddModelErrors(const Definition& definition,
                    const std::vector<inference::ModelErrorSummary>& errors,
                    v1::Posterior& message) {
  for (const inference::ModelErrorSummary& error : errors) {
    v1::Posterior::ModelError& out = *message.add_model_error();
    AddNames(definition, error.members, *out.mutable_observables());
    if (error.relative) AddSize(*error.relative, *out.mutable_relative());
    if (error.absolute) AddSize(*error.absolute, *out.mutable_absolute());
  }
}

// Thinned evenly.
void AddDraws(const Eigen::MatrixXd& draws, v1::Posterior& message) {
  const Eigen::Index stride = std::max<Eigen::Index>(1, draws.rows() / kDraws);
  for (Eigen::Index i = 0; i < draws.rows(); i += stride) {
    for (Eigen::Index j = 0; j < draws.cols(); ++j) {
      message.add_draws(draws(i, j));
    }
  }
}

void AddBands(const Definition& definition, const inference::EmulatedResult& emulated,
              v1::Posterior& message) {
  std::map<std::pair<int, int>, v1::Posterior::Band> bands;  // by (experiment, observable)
  for (std::size_t t = 0; t < definition.data.readings.size(); ++t) {
    const inference::Reading& reading = definition.data.readings[t];
    const auto row = static_cast<Eigen::Index>(t);
    const campaign::Experiment& experiment =
        definition.campaign.experiments[static_cast<std::size_t>(reading.experiment)];
    v1::Posterior::Band& band = bands[{reading.experiment, reading.observable}];
    band.set_experiment(experiment.name);
    band.set_observable(experiment.observables[static_cast<std::size_t>(reading.observable)].name);
    band.add_load_step(reading.load_step);
    band.add_mean(emulated.predictive_mean[row]);
    band.add_q05(emulated.predictive_q05[row]);
    band.add_q95(emulated.predictive_q95[row]);
    band.add_q025(emulated.predictive_q025[row]);
    band.add_q25(emulated.predictive_q25[row]);
    band.add_q50(emulated.predictive_q50[row]);
    band.add_q75(emulated.predictive_q75[row]);
    band.add_q975(emulated.predictive_q975[row]);
  }
  for (auto& [key, band] : bands) {
    *message.add_bands() = std::move(band);
  }
}

void AddEmulator(const Definition& definition, const inference::EmulatedResult& emulated,
                 v1::Posterior& message) {
  v1::Posterior::Emulator& out = *message.mutable_emulator();
  out.set_adequate(emulated.adequate);
  out.set_reason(emulated.reason);
  out.set_runs(emulated.runs);
  out.set_components(emulated.components);
  out.set_error(emulated.cross_validated_error);
  out.set_scatter(emulated.scatter);
  out.set_calibration(emulated.calibration);
  out.set_unknown(emulated.emulator_sd);
  out.set_widened(emulated.widened);
  if (emulated.adequate) {
    AddDraws(emulated.draws, message);
    AddBands(definition, emulated, message);
  }
}

void AddStages(const Definition& definition, const Answer& answer, v1::Posterior& message) {
  if (answer.stage_p.empty() || !answer.HasIntervals()) return;
  std::size_t at = 0;
  for (const Stage& stage : StagesOf(definition)) {
    const double p = answer.stage_p[at++];
    if (!std::isfinite(p)) continue;
    const campaign::Experiment& experiment =
        definition.campaign.experiments[static_cast<std::size_t>(stage.experiment)];
    v1::Posterior::StageP& out = *message.add_stage_p();
    out.set_experiment(experiment.name);
    out.set_observable(experiment.observables[static_cast<std::size_t>(stage.observable)].name);
    out.set_first(stage.first);
    out.set_last(stage.last);
    out.set_p(p);
  }
}

void AddScatter(const Definition& definition, const Answer& answer, v1::Posterior& message) {
  for (const ObservableScatter& scatter : answer.scatter) {
    const campaign::Experiment& experiment =
        definition.campaign.experiments[static_cast<std::size_t>(scatter.group.experiment)];
    v1::Posterior::Scatter& out = *message.add_scatter();
    out.set_experiment(experiment.name);
    out.set_observable(
        experiment.observables[static_cast<std::size_t>(scatter.group.observable)].name);
    for (Eigen::Index i = 0; i < scatter.group.sd.size(); ++i) {
      out.add_load_step(static_cast<int>(i));
      out.add_sd(scatter.group.sd[i]);
      out.add_clock(scatter.group.clock[i]);
    }
    out.set_correlation_length(scatter.group.length);
    out.set_share(scatter.group.share);
    out.set_from(scatter.from);
    out.set_runs(scatter.runs);
  }
}

using Json = nlohmann::json;

}  // namespace

v1::Posterior ToMessage(const Definition& definition, const Answer& answer, int iteration,
                        bool converged) {
  const inference::Posterior& posterior = answer.weighted;
  const bool emulated = answer.FromEmulator();
  v1::Posterior message;
  message.set_posterior_from(emulated               ? "emulator"
                             : answer.FromWeights() ? answer.weights_source
                                                    : "none");
  message.set_iteration(iteration);
  message.set_iterations(iteration + 1);
  message.set_converged(converged);
  message.set_log_evidence(emulated ? answer.emulated->log_evidence : posterior.log_evidence);
  message.set_log_evidence_se(!answer.HasIntervals() ? std::numeric_limits<double>::quiet_NaN()
                              : emulated             ? answer.emulated->log_evidence_se
                                                     : posterior.log_evidence_se);
  message.set_ess(posterior.ess);
  message.set_pareto_k(posterior.pareto_k);
  if (posterior.sigma.has_value()) {
    message.set_sigma(*posterior.sigma);
  }
  AddParameters(definition, answer, message);
  AddMembers(definition.campaign, answer, message);
  if (answer.HasIntervals()) {
    const Eigen::MatrixXd& correlation =
        emulated ? answer.emulated->correlation : posterior.correlation;
    for (const double value : correlation.reshaped()) {  // symmetric
      message.add_correlation(value);
    }
  }
  AddDraws(answer.draws, message);
  if (answer.emulated.has_value()) {
    AddEmulator(definition, *answer.emulated, message);
  }
  AddScatter(definition, answer, message);
  AddPath(definition, emulated ? answer.emulated->path : posterior.path, *message.mutable_path());
  AddPath(definition, emulated ? answer.emulated->reversed_path : posterior.reversed_path,
          *message.mutable_reversed_path());
  AddNoiseScale(definition, emulated ? answer.emulated->noise_scale : posterior.noise_scale,
                message);
  AddModelErrors(definition, emulated ? answer.emulated->model_errors : posterior.model_errors,
                 message);
  const std::optional<double>& predictive_p =
      emulated ? answer.emulated->predictive_p : posterior.predictive_p;
  if (answer.HasIntervals() && predictive_p.has_value()) {
    message.set_predictive_p(*predictive_p);
  }
  AddStages(definition, answer, message);
  for (const Answer::Placed& batch : answer.batches) {
    v1::Posterior::PlacedBatch& out = *message.add_batches();
    out.set_runs(batch.runs);
    out.set_expected_gain(batch.expected_gain);
  }
  message.mutable_warnings()->Add(answer.warnings.begin(), answer.warnings.end());
  AddTails(definition, answer, message);
  message.set_noise(campaign::WordOf(campaign::kNoiseModeWords, definition.campaign.filter.noise));
  return message;
}

std::string PosteriorToJson(const v1::Posterior& posterior) {
  std::string json;
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  // Fails only for maps and Any of unknown types, which the message does not have.
  (void)google::protobuf::util::MessageToJsonString(posterior, &json, options);
  return json;
}

absl::StatusOr<v1::Posterior> PosteriorFromJson(const std::string& json) {
  v1::Posterior posterior;
  if (const auto status = google::protobuf::util::JsonStringToMessage(json, &posterior);
      !status.ok()) {
    return absl::DataLossError(absl::StrCat("stored posterior: ", std::string(status.message())));
  }
  return posterior;
}

std::string ProposalToJson(const inference::Proposal& proposal) {
  Json json{{"defensive_share", proposal.defensive_share},
            {"log_acceptance", proposal.log_acceptance},
            {"components", Json::array()}};
  for (const std::optional<double>& held : proposal.frozen) {
    json["frozen"].push_back(held.has_value() ? Json(*held) : Json(nullptr));
  }
  for (const auto& component : proposal.components) {
    json["components"].push_back({{"weight", component.weight},
                                  {"mean", VectorToJson(component.mean)},
                                  {"covariance", VectorToJson(component.covariance.reshaped())}});
  }
  return json.dump();
}

absl::StatusOr<inference::Proposal> ProposalFromJson(const std::string& text) {
  try {
    const Json json = Json::parse(text);
    inference::Proposal proposal;
    proposal.defensive_share = json.at("defensive_share").get<double>();
    proposal.log_acceptance = json.at("log_acceptance").get<double>();
    for (const Json& item : json.value("frozen", Json::array())) {
      proposal.frozen.push_back(item.is_null() ? std::nullopt
                                               : std::optional<double>(item.get<double>()));
    }
    for (const Json& item : json.at("components")) {
      inference::Proposal::Component component;
      component.weight = item.at("weight").get<double>();
      component.mean = VectorFromJson(item.at("mean"));
      const Eigen::Index d = component.mean.size();
      component.covariance = VectorFromJson(item.at("covariance")).reshaped(d, d);
      proposal.components.push_back(std::move(component));
    }
    return proposal;
  } catch (const Json::exception& error) {
    return absl::DataLossError(absl::StrCat("stored proposal: ", error.what()));
  }
}

inference::Posterior MeansOf(const v1::Posterior& posterior) {
  inference::Posterior means;
  for (const auto& parameter : posterior.parameters()) {
    inference::ParameterSummary& summary = means.parameters.emplace_back();
    summary.mean = parameter.mean();
    summary.sd = parameter.sd();
    summary.cov = parameter.cov();
  }
  return means;
}

}  // namespace calib::planning
