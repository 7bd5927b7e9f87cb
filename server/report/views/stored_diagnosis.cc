#include "server/report/views/stored_diagnosis.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "server/report/text/people_units.h"
#include "server/report/views/lenient_json.h"

namespace calib::report {
namespace {

using Json = nlohmann::json;

std::vector<std::string> Names(const Json& json) {
  std::vector<std::string> names;
  if (!json.is_array()) return names;
  for (const Json& name : json) {
    if (name.is_string()) names.push_back(name);
  }
  return names;
}

std::vector<ProbableEffects> ReadProbable(const Json& json, const char* key) {
  std::vector<ProbableEffects> list;
  const auto found = json.find(key);
  if (found == json.end() || !found->is_array()) return list;
  for (const Json& entry : *found) {
    if (!entry.is_object() || !entry.contains("effects")) continue;
    Read(entry, "probability", list.emplace_back().probability);
    list.back().effects = Names(entry["effects"]);
  }
  return list;
}

std::vector<EvidenceOfEffects> ReadEvidences(const Json& json) {
  std::vector<EvidenceOfEffects> list;
  const auto found = json.find("log_evidences");
  if (found == json.end() || !found->is_array()) return list;
  for (const Json& entry : *found) {
    if (!entry.is_object() || !entry.contains("effects")) continue;
    EvidenceOfEffects own{.effects = Names(entry["effects"]),
                          .log_evidence = std::nan(""),
                          .log_evidence_se = std::nan("")};
    Read(entry, "log_evidence", own.log_evidence);
    Read(entry, "log_evidence_se", own.log_evidence_se);
    if (std::isfinite(own.log_evidence) && own.log_evidence_se >= 0) list.push_back(own);
  }
  return list;
}

std::vector<EffectCurve> ReadCurves(const Json& json) {
  std::vector<EffectCurve> curves;
  const auto found = json.find("curves");
  if (found == json.end() || !found->is_array()) return curves;
  for (const Json& entry : *found) {
    if (!entry.is_object() || !entry.contains("change") || !entry["change"].is_array()) continue;
    EffectCurve& curve = curves.emplace_back();
    Read(entry, "experiment", curve.experiment);
    Read(entry, "observable", curve.observable);
    for (const Json& value : entry["change"]) {
      curve.change.push_back(value.is_number() ? value.get<double>() : std::nan(""));
    }
  }
  return curves;
}

TriedEffect ReadTried(const Json& json) {
  TriedEffect tried;
  Read(json, "effect", tried.effect);
  Read(json, "probability", tried.probability);
  Read(json, "alone", tried.alone);
  tried.curves = ReadCurves(json);
  Read(json, "p_value", tried.p_value);
  Read(json, "explained_fraction", tried.explained_fraction);
  Read(json, "predicted_rms_error", tried.predicted_rms_error);
  Read(json, "amplitude", tried.amplitude);
  Read(json, "confusable_with", tried.confusable_with);
  Read(json, "angles", tried.angles);
  const auto fit = json.find("warm_fit");
  if (fit != json.end() && fit->is_object()) {
    Read(*fit, "p_value", tried.refit_p_value);
    Read(*fit, "advantage_nats", tried.advantage_nats);
    Read(*fit, "left_out_error", tried.left_out_error);
  }
  return tried;
}

std::vector<StoredProposal> ReadProposals(const Json& next) {
  std::vector<StoredProposal> proposals;
  const auto considered = next.find("considered");
  if (considered == next.end() || !considered->is_array()) return proposals;
  for (const Json& planned : *considered) {
    if (!planned.is_object()) continue;
    const auto forecast = planned.find("forecast");
    if (forecast == planned.end() || !forecast->is_object()) continue;
    StoredProposal& own = proposals.emplace_back();
    Read(planned, "in_words", own.in_words);
    Read(*forecast, "decides", own.decides);
    Read(*forecast, "told_apart_bits", own.bits);
  }
  return proposals;
}

}  // namespace

absl::StatusOr<StoredDiagnosis> ReadDiagnosis(const std::string& text) {
  const Json json = Json::parse(text, nullptr, false);
  StoredDiagnosis d;
  if (json.is_object()) {
    Read(json, "campaign", d.campaign);
    Read(json, "verdict", d.verdict);
  }
  if (d.campaign.empty() || d.verdict.empty()) {
    return absl::InvalidArgumentError("the document kept as a diagnosis is none");
  }
  Read(json, "effect", d.effect);
  d.probabilities = ReadProbable(json, "probabilities");
  d.evidences = ReadEvidences(json);
  Read(json, "none_of_these", d.none_of_these);
  d.families = ReadProbable(json, "families");
  if (const auto set = json.find("credible_set"); set != json.end() && set->is_array()) {
    for (const Json& model : *set) d.credible_set.push_back(Names(model));
  }
  if (const auto specimens = json.find("specimens");
      specimens != json.end() && specimens->is_object()) {
    Read(*specimens, "repeat_names_alone", d.repeat_names_alone);
  }
  Read(json, "sentence", d.sentence);
  Read(json, "only_adequacy", d.only_adequacy);
  if (const auto adequacy = json.find("adequacy");
      adequacy != json.end() && adequacy->is_object()) {
    Read(*adequacy, "rms", d.rms);
    Read(*adequacy, "chi2", d.chi2);
    Read(*adequacy, "degrees", d.degrees);
    Read(*adequacy, "p_value", d.p_value);
    Read(*adequacy, "p_chi2", d.p_chi2);
    Read(*adequacy, "p_stages", d.p_stages);
    Read(*adequacy, "left_out_error", d.left_out_error);
  }
  if (const auto candidates = json.find("candidates");
      candidates != json.end() && candidates->is_array()) {
    for (const Json& candidate : *candidates) {
      if (candidate.is_object()) d.candidates.push_back(ReadTried(candidate));
    }
  }
  Read(json, "units", d.units);
  Read(json, "not_excitable", d.not_excitable);
  Read(json, "undetectable", d.undetectable);
  Read(json, "warnings", d.warnings);
  if (const auto found = json.find("detectable"); found != json.end() && found->is_object()) {
    for (const auto& [effect, strength] : found->items()) {
      Read(*found, effect.c_str(), d.detectable[effect]);
    }
  }
  if (const auto next = json.find("next_experiment"); next != json.end() && next->is_object()) {
    Read(*next, "snippet", d.next_experiment);
    Read(*next, "in_words", d.next_in_words);
    Read(*next, "separates", d.next_separates);
    Read(*next, "expected_power", d.next_power);
    d.proposals = ReadProposals(*next);
    if (const auto pairs = next->find("not_separated"); pairs != next->end()) {
      for (const Json& pair : *pairs) {
        if (pair.is_array() && pair.size() == 2 && pair[0].is_string() && pair[1].is_string()) {
          d.next_together.emplace_back(pair[0], pair[1]);
        }
      }
    }
  }
  if (const auto then = json.find("then"); then != json.end() && then->is_object())
    Read(*then, "file", d.then_file);
  return d;
}

const StoredDiagnosis* LatestOf(const std::vector<StoredDiagnosis>& diagnoses,
                                const std::string& campaign) {
  const StoredDiagnosis* latest = nullptr;
  for (const StoredDiagnosis& d : diagnoses) {
    if (d.campaign != campaign) continue;
    const bool says_less = latest != nullptr && d.verdict == latest->verdict &&
                           d.chi2 == latest->chi2 && d.next_experiment.empty() &&
                           d.then_file == latest->then_file && !latest->next_experiment.empty();
    if (says_less) continue;  // improve asks for no next experiment
    if (latest == nullptr || latest->only_adequacy || !d.only_adequacy) latest = &d;
  }
  return latest;
}

std::string PValuesInWords(double p_value, std::optional<double> p_chi2,
                           std::optional<double> p_stages) {
  if (!p_chi2 || !p_stages) return fmt::format("p = {}", Number(p_value, 2));
  return fmt::format("p = {}; of means and trends of the stages {}; together {}",
                     Number(*p_chi2, 2), Number(*p_stages, 2), Number(p_value, 2));
}

std::string StrengthInWords(const std::map<std::string, double>& amplitude,
                            const std::map<std::string, std::string>& units) {
  std::string text;
  for (const auto& [name, value] : amplitude) {
    const auto unit = units.find(name);
    text += fmt::format("{}{} = {}", text.empty() ? "" : ", ", name,
                        NumberWithUnit(value, name, unit == units.end() ? "1" : unit->second, 3));
  }
  return text;
}

}  // namespace calib::report
