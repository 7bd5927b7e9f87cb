// The posterior, as JSON.
#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "server/report/documents/json_documents.h"
#include "server/report/documents/json_text.h"

namespace calib::report {
namespace {

using Json = nlohmann::ordered_json;

Json Emulator(const v1::Posterior& p) {
  if (!p.has_emulator()) return nullptr;
  const v1::Posterior::Emulator& e = p.emulator();
  return {{"adequate", e.adequate()},
          {"reason", e.reason()},
          {"runs", e.runs()},
          {"components", e.components()},
          {"cross_validated_error", e.error()},
          {"scatter", e.scatter()},
          {"calibration", e.calibration()},
          {"unknown", e.unknown()},
          {"widened", e.widened()}};
}

// order: places of the parameters.
std::vector<double> InOrder(const google::protobuf::RepeatedField<double>& values,
                            const std::vector<int>& order) {
  if (values.size() != static_cast<int>(order.size())) return {values.begin(), values.end()};
  std::vector<double> ordered;
  ordered.reserve(order.size());
  for (const int place : order) ordered.push_back(values.Get(place));
  return ordered;
}

// The posterior along the readings: means and coefficients of variation in the order of the
// parameters.
Json Path(const google::protobuf::RepeatedPtrField<v1::Posterior::PathPoint>& points,
          const std::vector<int>& order) {
  Json path = Json::array();
  for (const auto& point : points) {
    path.push_back({{"experiment", point.experiment()},
                    {"load_step", point.load_step()},
                    {"mean", InOrder(point.mean(), order)},
                    {"cov", InOrder(point.cov(), order)},
                    {"ess", point.ess()}});
  }
  return path;
}

Json Pairs(const DensityCurve& curve) {
  if (curve.empty()) return nullptr;
  Json pairs = Json::array();
  for (const auto& [x, p] : curve) pairs.push_back({x, p});
  return pairs;
}

Json PosteriorFields(const v1::Posterior& p,
                     std::span<const campaign::CalibratedParameter> campaign_parameters,
                     const PosteriorShape& shape) {
  Json parameters = Json::object();
  Json nuisance = Json::object();
  // Whatever has a place per parameter is in the order of these two: the wanted come first.
  std::vector<int> order;
  for (const bool wanted : {true, false}) {
    for (int j = 0; j < p.parameters_size(); ++j) {
      if (p.parameters(j).nuisance() != wanted) order.push_back(j);
    }
  }
  const auto bound = [&](const std::string& name, double inference::Prior::*end,
                         double shown) -> Json {
    for (const campaign::CalibratedParameter& one : campaign_parameters) {
      if (one.name == name && !std::isfinite(one.prior.*end)) return nullptr;
    }
    return shown;
  };
  const auto add = [&](const v1::Posterior::Parameter& q, bool is_member) {
    (q.nuisance() ? nuisance : parameters)[q.name()] = {
        {"mean", q.mean()},
        {"sd", q.sd()},
        {"cov", q.cov()},
        {"q05", q.q05()},
        {"q50", q.q50()},
        {"q95", q.q95()},
        {"unit", q.unit()},
        {"at_bound", q.at_bound()},
        {"prior_min",
         is_member ? Json(nullptr) : bound(q.name(), &inference::Prior::min, q.prior_min())},
        {"prior_max",
         is_member ? Json(nullptr) : bound(q.name(), &inference::Prior::max, q.prior_max())},
        {"conditioned_on", q.conditioned_on()},
        {"split_half", q.split_half()},
        {"prior_density", nullptr},
        {"density", nullptr}};
  };
  for (const auto& q : p.parameters()) add(q, false);
  // Behind the others, which have places in correlation and path.
  for (const auto& q : p.members()) {
    add(q, true);
    (q.nuisance() ? nuisance : parameters)[q.name()]["member"] = true;
  }
  for (std::size_t j = 0; j < shape.parameters.size(); ++j) {
    const std::string& name = shape.parameters[j];
    Json& parameter = (nuisance.contains(name) ? nuisance : parameters)[name];
    parameter["prior_density"] = Pairs(shape.prior[j]);
    parameter["density"] = Pairs(shape.density[j]);
  }
  Json noise_scale = Json::array();
  for (const auto& scale : p.noise_scale()) {
    noise_scale.push_back({{"observables", std::vector<std::string>(scale.observables().begin(),
                                                                    scale.observables().end())},
                           {"q05", scale.q05()},
                           {"q50", scale.q50()},
                           {"q95", scale.q95()}});
  }
  Json model_error = Json::array();
  const auto size_of = [](const v1::Posterior::ModelError::Size& size) {
    return Json{{"mean", size.mean()},
                {"sd", size.sd()},
                {"q05", size.q05()},
                {"q50", size.q50()},
                {"q95", size.q95()}};
  };
  for (const auto& error : p.model_error()) {
    Json entry{{"observables",
                std::vector<std::string>(error.observables().begin(), error.observables().end())}};
    if (error.has_relative()) entry["relative"] = size_of(error.relative());
    if (error.has_absolute()) entry["absolute"] = size_of(error.absolute());
    model_error.push_back(std::move(entry));
  }
  Json batches = Json::array();
  for (const auto& batch : p.batches()) {
    batches.push_back({{"runs", batch.runs()}, {"expected_gain", batch.expected_gain()}});
  }
  Json correlation = Json::array();
  const int d = p.parameters_size();
  for (int i = 0; i < d && p.correlation_size() == d * d; ++i) {
    Json row = Json::array();
    const int place = order[static_cast<std::size_t>(i)];
    for (const int j : order) row.push_back(p.correlation(place * d + j));
    correlation.push_back(std::move(row));
  }
  Json warnings = Json::array();
  for (const std::string& warning : p.warnings()) warnings.push_back(warning);
  return {{"campaign", p.campaign()},
          {"iteration", p.iteration()},
          {"iterations", p.iterations()},
          {"converged", p.converged()},
          {"log_evidence", p.log_evidence()},
          {"log_evidence_se", p.log_evidence_se()},
          {"parameters", parameters},
          {"nuisance_parameters", nuisance},
          {"correlation", correlation},
          {"ess", p.ess()},
          {"pareto_k", p.pareto_k()},
          {"posterior_from", p.posterior_from()},
          {"emulator", Emulator(p)},
          {"sigma", p.has_sigma() ? Json(p.sigma()) : Json(nullptr)},
          {"noise", p.noise()},
          {"noise_scale", noise_scale},
          {"model_error", model_error},
          {"batches", batches},
          {"predictive_p", p.has_predictive_p() ? Json(p.predictive_p()) : Json(nullptr)},
          {"path", Path(p.path(), order)},
          {"reversed_path", Path(p.reversed_path(), order)},
          {"model_evaluations", p.model_evaluations()},
          {"stopped_early", p.stopped_early()},
          {"stated_loss", p.stated_loss()},
          {"unknown", p.unknown()},
          {"unknown_mass", p.unknown() > 0 ? Json(p.unknown_mass()) : Json(0)},
          {"audited", p.audited()},
          {"audited_bound", p.has_audited_bound() ? Json(p.audited_bound()) : Json(nullptr)},
          {"measured_loss", p.has_measured_loss() ? Json(p.measured_loss()) : Json(nullptr)},
          {"core_hours", p.core_hours()},
          {"draws", shape.draws.empty()
                        ? Json(nullptr)
                        : Json({{"parameters", shape.parameters}, {"values", shape.draws}})},
          {"warnings", warnings}};
}

}  // namespace

std::string PosteriorJson(const v1::Posterior& posterior,
                          std::span<const campaign::CalibratedParameter> parameters,
                          const PosteriorShape& shape) {
  return Dump(PosteriorFields(posterior, parameters, shape));
}

std::string TablePosteriorJson(const v1::CampaignStatus& status) {
  Json json = PosteriorFields({}, {}, {});
  for (auto& [name, value] : json.items()) {
    if (value.is_primitive()) value = nullptr;
  }
  json["campaign"] = status.campaign();
  json["model_evaluations"] = status.model_evaluations();
  json["core_hours"] = status.core_hours();
  return Dump(json);
}

}  // namespace calib::report
