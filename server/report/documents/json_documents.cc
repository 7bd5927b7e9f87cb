#include "server/report/documents/json_documents.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "server/campaign/file/text/data_file.h"
#include "server/messages/read_words.h"
#include "server/report/documents/json_text.h"
#include "server/report/views/residual_words.h"

namespace calib::report {
namespace {

using Json = nlohmann::ordered_json;

Json OrNull(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

template <typename Values>
Json Numbers(const Values& values) {
  Json array = Json::array();
  for (const double value : values) array.push_back(value);
  return array;
}

// Neither a misfit nor a number of effective samples is zero: nothing is known of it yet.
Json PositiveOrNull(double value) { return value > 0 ? Json(value) : Json(nullptr); }

Json Status(const v1::CampaignStatus& s) {
  return {{"campaign", s.campaign()},
          {"name", s.name()},
          {"state", s.state()},
          {"reason", s.reason()},
          {"phase", s.phase()},
          {"method", s.method()},
          {"iteration", s.iteration()},
          {"max_iterations", s.max_iterations()},
          {"samples", s.samples()},
          {"samples_done", s.samples_done()},
          {"samples_running", s.samples_running()},
          {"samples_resting", s.samples_resting()},
          {"samples_stopped_early", s.samples_stopped_early()},
          {"samples_diverged", s.samples_diverged()},
          {"samples_unknown", s.samples_unknown()},
          {"effective_sample_size", PositiveOrNull(s.effective_sample_size())},
          {"best_misfit", PositiveOrNull(s.best_misfit())},
          {"states_per_second", messages::IsOver(s) ? Json(nullptr) : Json(s.states_per_second())},
          {"eta_seconds", s.eta_seconds() < 0 ? Json(nullptr) : Json(s.eta_seconds())},
          {"model_evaluations", s.model_evaluations()},
          {"core_hours", s.core_hours()},
          {"converged", s.converged()},
          {"created_unix_ms", s.created_unix_ms()},
          {"owner", s.owner().empty() ? Json(nullptr) : Json(s.owner())},
          {"priority", s.priority()},
          {"parent", s.parent().empty() ? Json(nullptr) : Json(s.parent())},
          {"purpose", s.purpose().empty() ? Json(nullptr) : Json(s.purpose())},
          {"effects", std::vector<std::string>(s.effects().begin(), s.effects().end())},
          {"problem", s.problem().empty() ? Json(nullptr) : Json(s.problem())},
          {"nobody_may_run_it", s.nobody_may().empty() ? Json(nullptr) : Json(s.nobody_may())},
          {"server_waits", s.server_waits().empty() ? Json(nullptr) : Json(s.server_waits())}};
}

Json Pattern(const ResidualPattern& p) {
  return {{"name", ToString(p.shape)}, {"size", p.size}, {"z", p.z}, {"explained", p.explained}};
}

Json Drift(const ParameterDrift& d) {
  Json fits = Json::array();
  for (const PartialFit& fit : d.fits) {
    fits.push_back({{"experiment", fit.experiment},
                    {"segment", fit.segment.empty() ? Json(nullptr) : Json(fit.segment)},
                    {"mean", fit.mean},
                    {"sd", fit.sd},
                    {"z", fit.z}});
  }
  Json json = {{"parameter", d.parameter},
               {"unit", d.unit},
               {"p_experiments", OrNull(d.p_experiments)},
               {"p_segments", OrNull(d.p_segments)},
               {"trend", nullptr},
               {"fits", fits}};
  if (!d.trend_with.empty()) {
    json["trend"] = {{"with", d.trend_with}, {"per_decade", d.trend}, {"sd", d.trend_sd}};
  }
  return json;
}

}  // namespace

std::string SensitivityJson(const std::string& campaign, const Sensitivity& s) {
  const auto by_parameter = [&s](const Eigen::VectorXd& values, const Eigen::VectorXd& errors,
                                 const char* name) -> Json {
    if (values.size() == 0) return nullptr;
    Json json = Json::object();
    for (std::size_t j = 0; j < s.parameters.size(); ++j) {
      const auto row = static_cast<Eigen::Index>(j);
      json[s.parameters[j]] = {{name, values[row]}, {"error", errors[row]}};
    }
    return json;
  };
  Json quantities = Json::array();
  for (const Quantity& q : s.quantities) {
    const bool posterior = q.posterior.correlation.size() > 0;
    quantities.push_back(
        {{"experiment", q.experiment},
         {"quantity", q.name},
         {"unit", q.unit},
         {"runs", q.runs},
         {"explained", q.prior.explained},
         {"first_order", by_parameter(q.prior.indices.first, q.prior.indices.first_error, "index")},
         {"total", by_parameter(q.prior.indices.total, q.prior.indices.total_error, "index")},
         {"prior",
          {{"mean", q.prior.mean},
           {"sd", q.prior.sd},
           {"out_of_reach", q.prior.out_of_reach},
           {"correlation", by_parameter(q.prior.correlation, q.prior.correlation_error, "rank")}}},
         {"posterior",
          posterior ? Json{{"mean", q.posterior.mean},
                           {"sd", q.posterior.sd},
                           {"correlation", by_parameter(q.posterior.correlation,
                                                        q.posterior.correlation_error, "rank")}}
                    : Json(nullptr)}});
  }
  return Dump({{"campaign", campaign},
               {"parameters", s.parameters},
               {"independent", s.independent},
               {"posterior_from", ToString(s.points_from)},
               {"quantities", quantities},
               {"left_out", s.left_out},
               {"warnings", s.warnings}});
}

namespace {

Json CurvesOf(const ObservableCurves& o) {
  Json bands = nullptr;
  if (std::any_of(o.prediction.mean.begin(), o.prediction.mean.end(),
                  [](double mean) { return std::isfinite(mean); })) {
    const auto& [q025, q25, q50, q75, q975] = o.prediction.bands;
    bands = {{"mean", Numbers(o.prediction.mean)},
             {"q025", Numbers(q025)},
             {"q05", Numbers(o.prediction.q05)},
             {"q25", Numbers(q25)},
             {"q50", Numbers(q50)},
             {"q75", Numbers(q75)},
             {"q95", Numbers(o.prediction.q95)},
             {"q975", Numbers(q975)}};
  }
  Json runs = Json::array();
  for (const std::vector<double>& run : o.runs) runs.push_back(Numbers(run));
  return {{"name", o.name},
          {"unit", o.unit},
          {"values", Numbers(o.values)},
          {"sd", Numbers(o.sd)},
          {"total_sd", Numbers(o.total_sd)},
          {"bands", bands},
          {"residual", Numbers(o.residual)},
          {"runs", runs}};
}

Json CurvesOf(const ExperimentCurves& e) {
  Json settings = Json::object();
  for (const auto& [name, setting] : e.settings) {
    settings[name] = {{"value", setting.value}, {"unit", setting.unit}};
  }
  Json runs = Json::array();
  for (const DrawnRun& run : e.runs) {
    runs.push_back({{"sample", run.sample},
                    {"rank", run.rank ? Json(*run.rank) : Json(nullptr)},
                    {"status", run.status},
                    {"weight", run.weight},
                    {"log_likelihood", run.log_likelihood}});
  }
  Json observables = Json::array();
  for (const ObservableCurves& o : e.observables) observables.push_back(CurvesOf(o));
  return {{"experiment", e.experiment},
          {"test", e.test},
          {"role", e.heldout ? "validate" : "calibrate"},
          {"settings", settings},
          {"control", e.control},
          {"control_unit", e.control_unit},
          {"control_values", Numbers(e.control_values)},
          {"segments", e.segments},
          {"runs", runs},
          {"observables", observables}};
}

}  // namespace

std::string ComparisonJson(const std::string& campaign, const Comparison& c,
                           const std::vector<ExperimentCurves>& curves) {
  Json experiments = Json::array();
  for (const ExperimentCurves& e : curves) experiments.push_back(CurvesOf(e));
  Json by_observable = Json::array();
  for (const ObservableMisfit& m : c.by_observable) {
    by_observable.push_back({{"experiment", m.experiment},
                             {"observable", m.observable},
                             {"rms_error", m.rms_error},
                             {"z", OrNull(m.z)},
                             {"p_value", OrNull(m.p_value)},
                             {"predictive_p", OrNull(m.predictive_p)},
                             {"rms_residual", m.rms_residual},
                             {"scatter_over_noise", m.scatter},
                             {"scatter_from", m.scatter_from},
                             {"readings", m.readings},
                             {"effective_readings", m.effective_readings},
                             {"pattern", Pattern(m.pattern)},
                             {"role", m.heldout ? "validate" : "calibrate"}});
  }
  Json by_segment = Json::array();
  for (const SegmentMisfit& m : c.by_segment) {
    by_segment.push_back({{"experiment", m.experiment},
                          {"observable", m.observable},
                          {"segment", m.segment},
                          {"from", m.from},
                          {"to", m.to},
                          {"bias", m.bias},
                          {"z", OrNull(m.z)},
                          {"p_value", OrNull(m.p_value)},
                          {"predictive_p", OrNull(m.predictive_p)},
                          {"readings", m.readings},
                          {"effective_readings", m.effective_readings},
                          {"rms_error", m.rms_error},
                          {"chi2_share", OrNull(m.chi2_share)},
                          {"pattern", Pattern(m.pattern)},
                          {"role", m.heldout ? "validate" : "calibrate"}});
  }
  Json drift = Json::array();
  for (const ParameterDrift& d : c.parameter_drift) drift.push_back(Drift(d));
  Json discrepancy = Json::array();
  for (const ObservableDiscrepancy& d : c.discrepancies) {
    discrepancy.push_back({{"experiment", d.experiment},
                           {"observable", d.observable},
                           {"heldout", d.heldout},
                           {"probability", d.probability},
                           {"log_bayes_factor", d.log_bayes_factor},
                           {"amplitude", d.amplitude},
                           {"length", d.length},
                           {"alike", d.alike},
                           {"mean", d.mean},
                           {"sd", d.sd},
                           {"largest",
                            {{"control", d.largest_at},
                             {"segment", d.segment},
                             {"mean", d.mean[d.largest]},
                             {"sd", d.sd[d.largest]}}}});
  }
  Json conflicts = Json::array();
  for (const PriorConflict& p : c.prior_conflicts) {
    conflicts.push_back({{"experiment", p.experiment},
                         {"observable", p.observable},
                         {"from", p.from},
                         {"to", p.to},
                         {"readings", p.readings},
                         {"model_is", p.too_low ? "too_low" : "too_high"},
                         {"nearest", p.nearest},
                         {"text", InWords(p)}});
  }
  Json trends = Json::array();
  for (const BiasTrend& t : c.trends) {
    trends.push_back({{"observable", t.observable},
                      {"segment", t.segment},
                      {"with", t.with},
                      {"per_decade", t.per_decade},
                      {"z", t.z}});
  }
  return Dump({{"campaign", campaign},
               {"rms_error", c.rms_error},
               {"reduced_chi2", OrNull(c.reduced_chi2)},
               {"p_value", OrNull(c.p_value)},
               {"predictive_p", OrNull(c.predictive_p)},
               {"heldout_rms_error", OrNull(c.heldout_rms_error)},
               {"by_observable", by_observable},
               {"by_segment", by_segment},
               {"parameter_drift", drift},
               {"trends", trends},
               {"discrepancy", discrepancy},
               {"prior_conflicts", conflicts},
               {"where_it_fails", WhereItFails(c)},
               {"at_bound", c.at_bound},
               {"experiments", experiments},
               {"warnings", c.warnings},
               {"note", c.note}});
}

std::string ModelsJson(const ModelComparison& comparison) {
  Json models = Json::array();
  for (const ComparedModel& m : comparison.models) {
    models.push_back({{"campaign", m.campaign},
                      {"name", m.name},
                      {"log_evidence", m.log_evidence},
                      {"log_evidence_se", m.log_evidence_se},
                      {"probability", m.probability.probability},
                      {"probability_q05", m.probability.q05},
                      {"probability_q95", m.probability.q95},
                      {"bayes_factor", std::exp(m.probability.log_bayes_factor)},
                      {"log_bayes_factor", m.probability.log_bayes_factor},
                      {"log_bayes_factor_se", m.probability.log_bayes_factor_se}});
  }
  return Dump({{"models", models},
               {"evidence_from", comparison.evidence_from},
               {"warnings", comparison.warnings}});
}

std::string StatusJson(const v1::CampaignStatus& status) { return Dump(Status(status)); }

std::string ShownJson(const Shown& shown) {
  Json json = Status(shown.status);
  json["warnings"] = shown.warnings;
  json["children"] = Json::array();
  for (const v1::CampaignStatus& child : shown.children) {
    json["children"].push_back({{"campaign", child.campaign()},
                                {"purpose", child.purpose()},
                                {"name", child.name()},
                                {"state", child.state()}});
  }
  json["findings"] = Json::array();
  for (const v1::Finding& finding : shown.findings) {
    json["findings"].push_back({{"kind", finding.kind()},
                                {"digest", finding.digest()},
                                {"created_unix_ms", finding.created_unix_ms()}});
  }
  json["next_command"] = shown.next_command.empty() ? Json(nullptr) : Json(shown.next_command);
  return Dump(json);
}

std::string StatusListJson(const std::vector<v1::CampaignStatus>& statuses) {
  Json list = Json::array();
  for (const v1::CampaignStatus& status : statuses) list.push_back(Status(status));
  return Dump(list);
}

std::string LineageJson(const std::string& campaign, const std::vector<Branch>& family) {
  Json nodes = Json::array();
  for (const Branch& branch : family) {
    const v1::CampaignStatus& s = branch.status;
    nodes.push_back({{"campaign", s.campaign()},
                     {"name", s.name()},
                     {"state", s.state()},
                     {"priority", s.priority()},
                     {"parent", s.parent().empty() ? Json(nullptr) : Json(s.parent())},
                     {"purpose", s.purpose().empty() ? Json(nullptr) : Json(s.purpose())},
                     {"effects", std::vector<std::string>(s.effects().begin(), s.effects().end())},
                     {"depth", branch.depth}});
  }
  return Dump({{"campaign", campaign}, {"nodes", nodes}});
}

namespace {

Json KeptJson(const v1::Sample& sample) {
  Json kept = Json::array();
  for (const v1::KeptFile& file : sample.kept()) {
    kept.push_back({{"experiment", file.experiment()},
                    {"name", file.name()},
                    {"digest", file.digest().empty() ? Json(nullptr) : Json(file.digest())},
                    {"reason", file.reason()}});
  }
  return kept;
}

}  // namespace

std::string SamplesJson(const std::string& campaign,
                        std::span<const campaign::CalibratedParameter> parameters,
                        const std::vector<v1::Sample>& samples) {
  Json units = Json::object();
  for (const campaign::CalibratedParameter& p : parameters) units[p.name] = p.unit;
  Json list = Json::array();
  for (const v1::Sample& s : samples) {
    Json values = Json::object();
    for (int k = 0; k < s.parameters_size(); ++k) {
      const auto index = static_cast<std::size_t>(k);
      values[index < parameters.size() ? parameters[index].name : std::to_string(k)] =
          s.parameters(k);
    }
    list.push_back({{"index", s.index()},
                    {"iteration", s.iteration()},
                    {"parameters", values},
                    {"status", s.status()},
                    {"reason", s.reason()},
                    {"weight", s.weight()},
                    {"log_likelihood", s.log_likelihood()},
                    {"attempts", s.attempts()},
                    {"words", s.words().empty() ? Json(nullptr) : Json(s.words())},
                    {"kept", KeptJson(s)},
                    {"purpose", s.purpose()}});
  }
  return Dump({{"campaign", campaign}, {"units", units}, {"samples", list}});
}

std::string StatesJson(const std::string& campaign, int sample,
                       const std::map<std::string, StateHistory>& by_experiment) {
  Json experiments = Json::array();
  for (const auto& [name, history] : by_experiment) {
    Json states = Json::array();
    for (const v1::State& state : history.states) {
      Json row = {{"load_step", state.load_step()}};
      for (int k = 0; k < state.values_size(); ++k) {
        const auto index = static_cast<std::size_t>(k);
        if (index < history.observables.size()) row[history.observables[index]] = state.values(k);
      }
      for (const auto& [other, value] : state.others()) row[other] = value;
      states.push_back(std::move(row));
    }
    experiments.push_back({{"experiment", name}, {"states", states}});
  }
  return Dump({{"campaign", campaign}, {"sample", sample}, {"experiments", experiments}});
}

std::string StateTableJson(const std::string& csv) {
  std::vector<campaign::TableProblem>
      ignored;  // the table is our own; without rows it has no states
  const campaign::DataTable table(csv, {}, ignored);
  std::vector<std::vector<std::string>> columns;
  columns.reserve(table.columns().size());
  for (const std::string& name : table.columns()) columns.push_back(table.Texts(name));
  Json states = Json::array();
  for (std::size_t row = 0; row < table.rows(); ++row) {
    Json state = Json::object();
    for (std::size_t k = 0; k < columns.size(); ++k) {
      const std::string& text = columns[k][row];
      const bool number = table.columns()[k] != "experiment";
      state[table.columns()[k]] = number ? Json::parse(text, nullptr, false) : Json(text);
    }
    for (auto& value : state) {
      if (value.is_discarded()) value = nullptr;  // no such observable in this experiment
    }
    states.push_back(std::move(state));
  }
  return Dump({{"states", states}});
}

std::string WorkersJson(const std::vector<v1::WorkerInfo>& workers) {
  Json list = Json::array();
  for (const v1::WorkerInfo& w : workers) {
    Json running = Json::array();
    for (const std::string& what : w.running()) running.push_back(what);
    list.push_back(
        {{"name", w.name()},
         {"slots", w.slots()},
         {"threads", w.threads()},
         {"memory", w.memory() > 0 ? Json(w.memory()) : Json(nullptr)},
         {"user", w.user().empty() ? Json(nullptr) : Json(w.user())},
         {"programs", std::vector<std::string>(w.programs().begin(), w.programs().end())},
         {"busy", w.busy()},
         {"contact_updates_per_second", w.contact_updates_per_second()},
         {"cpu", w.cpu()},
         {"draining", w.draining()},
         {"connected", w.connected()},
         {"left", w.left()},
         {"waits", w.waits().empty() ? Json(nullptr) : Json(w.waits())},
         {"seconds_since_heard", w.seconds_since_heard()},
         {"running", running},
         {"engine_version", w.engine_version()}});
  }
  return Dump(list);
}

std::string DataJson(const campaign::Campaign& campaign) {
  Json experiments = Json::array();
  for (const campaign::Experiment& e : campaign.experiments) {
    Json observables = Json::array();
    for (const campaign::MeasuredObservable& o : e.observables) {
      observables.push_back({{"name", o.name},
                             {"values", Numbers(o.values)},
                             {"sd", Numbers(o.sd)},
                             {"correlation_length", o.correlation_length}});
    }
    experiments.push_back({{"experiment", e.name},
                           {"test", e.test},
                           {"role", e.role == campaign::Role::kValidate ? "validate" : "calibrate"},
                           {"control", e.control_name},
                           {"control_values", Numbers(e.control)},
                           {"segments", e.segment},
                           {"observables", observables}});
  }
  return Dump({{"campaign", campaign.name}, {"experiments", experiments}});
}

}  // namespace calib::report
