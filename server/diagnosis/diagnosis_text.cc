#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "server/diagnosis/design_caps.h"
#include "server/diagnosis/diagnosis.h"
#include "server/diagnosis/plan_json.h"
#include "server/diagnosis/plan_words.h"
#include "server/report/text/people_units.h"
#include "server/report/text/text_table.h"
#include "server/report/views/stored_diagnosis.h"

namespace calib::diagnosis {
namespace {

using Json = nlohmann::json;
using report::Number;

constexpr double kListed = 1e-3;  // smallest probability of a model that is listed

Json OrNull(const std::string& text) { return text.empty() ? Json(nullptr) : Json(text); }

Json ReasonsJson(const std::vector<std::pair<std::string, std::string>>& list) {
  Json json = Json::array();
  for (const auto& [effect, reason] : list) {
    json.push_back({{"effect", effect}, {"reason", reason}});
  }
  return json;
}

// Models but for none of these, those that are not listed as one.
Json ProbabilitiesJson(const Answer& answer) {
  Json json = Json::array();
  double other = 0;
  for (const NamedModel& model : answer.probabilities) {
    if (model.none_of_these) continue;
    if (model.probability < kListed) {
      other += model.probability;
      continue;
    }
    json.push_back({{"effects", model.effects}, {"probability", model.probability}});
  }
  if (other > 0) json.push_back({{"effects", {"other"}}, {"probability", other}});
  return json;
}

// Of the base model, of every effect alone and of what is listed.
Json EvidencesJson(const Answer& answer) {
  Json json = Json::array();
  for (const NamedModel& model : answer.probabilities) {
    if (!std::isfinite(model.log_evidence) || !std::isfinite(model.log_evidence_se) ||
        (model.effects.size() > 1 && model.probability < kListed))
      continue;
    json.push_back({{"effects", model.effects},
                    {"log_evidence", model.log_evidence},
                    {"log_evidence_se", model.log_evidence_se}});
  }
  return json;
}

Json CredibleSetJson(const Answer& answer) {
  Json json = Json::array();
  for (const NamedModel& model : answer.credible_set) {
    json.push_back(model.none_of_these ? Json({"none_of_these"}) : Json(model.effects));
  }
  return json;
}

Json FamiliesJson(const Answer& answer) {
  Json json = Json::array();
  for (const NamedFamily& family : answer.families) {
    json.push_back({{"effects", family.effects}, {"probability", family.probability}});
  }
  return json;
}

// Of the credible set, but for this one, in the order of the candidates.
std::vector<std::string> OthersOfSet(const Answer& answer, const std::string& effect) {
  std::set<std::string> in_set;
  for (const NamedModel& model : answer.credible_set)
    in_set.insert(model.effects.begin(), model.effects.end());
  std::vector<std::string> others;
  for (const EffectAnswer& own : answer.candidates) {
    if (own.effect != effect && in_set.count(own.effect) > 0) others.push_back(own.effect);
  }
  return in_set.count(effect) > 0 ? others : std::vector<std::string>();
}

Json CurvesJson(const EffectAnswer& own) {
  Json json = Json::array();
  for (const ChangedCurve& curve : own.curves) {
    json.push_back({{"experiment", curve.experiment},
                    {"observable", curve.observable},
                    {"change", curve.change}});
  }
  return json;
}

Json NumericsJson(const Answer& answer) {
  Json json = Json::array();
  for (const NumericalChange& own : answer.numerics) {
    json.push_back(
        {{"name", own.name}, {"null", own.null}, {"tried", own.tried}, {"rms", own.rms}});
  }
  return json;
}

Json CandidateJson(const Answer& answer, const EffectAnswer& own) {
  const bool first = &own == &answer.candidates.front();
  return {{"effect", own.effect},
          {"probability", own.probability},
          {"probability_sd", own.uncertain},
          {"alone", own.alone},
          {"p_value", own.p_value},
          {"explained_fraction", own.explained},
          {"amplitude", own.amplitude},
          {"predicted_rms_error", own.rms},
          {"confusable_with", first ? OthersOfSet(answer, own.effect) : std::vector<std::string>()},
          {"angles", own.angles},
          {"curves", CurvesJson(own)}};
}

Json NextJson(const std::optional<NextExperiment>& next) {
  if (!next) return nullptr;
  Json json = PlannedJson(next->best);
  json["separates"] = next->separates;
  json["snippet"] = next->snippet;
  json["model_evaluations"] = next->evaluations;
  json["considered"] = Json::array();
  for (const PlannedExperiment& planned : next->considered) {
    json["considered"].push_back(PlannedJson(planned));
  }
  return json;
}

// Screened rivals that a planned test leaves together.
std::string NotTold(const PlannedExperiment& planned) {
  std::string text;
  for (const auto& [a, b] : planned.together) {
    text += fmt::format("{}{} from {}", text.empty() ? ", but not " : " nor ", a, b);
  }
  return text;
}

std::string CostOf(const PlannedExperiment& planned) {
  if (!(planned.core_seconds > 0)) return "";
  return fmt::format(" An evaluation costs about {} core seconds.",
                     Number(planned.core_seconds, 2));
}

std::string ForecastInWords(const PlanForecast& forecast) {
  return fmt::format("one answer, and the right one, with probability {} ({} bits)",
                     report::ChanceInWords(forecast.decides), Number(forecast.bits, 2));
}

std::string NextText(const NextExperiment& next) {
  std::string text =
      "\n" +
      report::Wrapped(
          fmt::format("Next experiment: {}. Expected of it: {}; a wrong name with {}.{} "
                      "For the campaign file:",
                      InWords(next.best), ForecastInWords(*next.best.forecast),
                      report::ChanceInWords(next.best.forecast->wrong), CostOf(next.best)),
          "", "") +
      "\n" + next.snippet;
  if (next.considered.size() > 1) text += "\nAlso tried:\n";
  for (std::size_t k = 1; k < next.considered.size(); ++k) {
    const PlannedExperiment& planned = next.considered[k];
    text += "  " + InWords(planned) + ": ";
    if (planned.forecast) {
      text += ForecastInWords(*planned.forecast) + "\n";
    } else if (planned.of_next) {
      text += "not known\n";
    } else {
      text += planned.expected_power < kToldApart
                  ? "at first sight tells none of them apart\n"
                  : fmt::format("at first sight {} sd apart{}\n", Number(planned.distance, 3),
                                NotTold(planned));
    }
  }
  return text;
}

Json ThenJson(const std::optional<ToldMeasurement>& then) {
  if (!then) return nullptr;
  return {{"file", then->file},
          {"digest", then->digest},
          {"plan", PlannedJson(then->plan)},
          {"in_words", InWords(then->plan)},
          {"campaign", OrNull(then->campaign)},
          {"model_evaluations", then->evaluations}};
}

// Effects that share a reason in one sentence.
std::string ByReason(const std::string& begin,
                     const std::vector<std::pair<std::string, std::string>>& list) {
  std::map<std::string, std::string> by_reason;
  for (const auto& [effect, reason] : list) {
    std::string& names = by_reason[reason];
    names += (names.empty() ? "" : ", ") + effect;
  }
  std::string text;
  for (const auto& [reason, names] : by_reason) {
    text += report::Wrapped(fmt::format("{} {}: {}.", begin, reason, names), "", "  ");
  }
  return text;
}

std::string Sentence(const Diagnosis& d) {
  std::string sentence = d.answer.sentence;
  if (d.then)
    sentence = fmt::format("With {} ({}): {}", d.then->file, InWords(d.then->plan), sentence);
  if (d.next_experiment && d.answer.verdict == AnswerVerdict::kAmbiguous &&
      d.next_experiment->best.repeats.empty()) {
    sentence += fmt::format(" {} would, with probability {}.", InWords(d.next_experiment->best),
                            report::ChanceInWords(d.next_experiment->best.expected_power));
  }
  return sentence +
         (d.in_doubt ? " This is in doubt, for what the warnings say of the readings." : "");
}

std::string NameOf(const NamedModel& model) {
  if (model.none_of_these) return "none of these";
  return model.effects.empty() ? "the model as it is"
                               : fmt::format("{}", fmt::join(model.effects, " + "));
}

// Below a hundredth of a percent nothing is counted.
std::string Probability(double probability) {
  return report::Percent(probability < 5e-5 ? 0 : probability, 3);
}

std::string ModelsText(const Answer& answer) {
  report::TextTable table({"<model", "probability"});
  double other = 0;
  for (const NamedModel& model : answer.probabilities) {
    if (model.probability < kListed) {
      other += model.probability;
      continue;
    }
    table.AddRow({NameOf(model), Probability(model.probability)});
  }
  if (other > 0) table.AddRow({"all others", report::Percent(other, 2)});
  return "\n" + table.ToString();
}

std::string EffectsText(const Answer& answer) {
  report::TextTable table({"<effect", "acts", "<named", "explains", "error", "p"});
  for (const EffectAnswer& own : answer.candidates) {
    table.AddRow({own.effect, Probability(own.probability), own.alone ? "yes" : "",
                  report::ShareExplained(own.explained), Number(own.rms, 3),
                  Number(own.p_value, 2)});
  }
  return "\n" + table.ToString() +
         report::Wrapped(
             fmt::format("Acts: probability that it acts, alone or with another. Explains, error, "
                         "p: of the model with it alone; share of the misfit beyond noise and "
                         "scatter; rms in sd of a measurement, {} without it; likelihood ratio.",
                         Number(answer.rms, 3)),
             "", "");
}

std::string FamiliesText(const Answer& answer) {
  std::string text;
  for (const NamedFamily& family : answer.families) {
    if (family.effects.size() < 2) continue;
    text += report::Wrapped(
        fmt::format("Of one family, or hardly told apart by these tests: {}; one of them acts "
                    "with probability {}.",
                    fmt::join(family.effects, ", "), report::ChanceInWords(family.probability)),
        "", "  ");
  }
  return text;
}

std::string DetectableText(const Diagnosis& d) {
  std::string text, never;
  for (const EffectAnswer& own : d.answer.candidates) {
    if (own.visible.empty()) {
      never += (never.empty() ? "" : ", ") + own.effect;
    } else {
      text += fmt::format("  {}: {}\n", own.effect, report::StrengthInWords(own.visible, d.units));
    }
  }
  if (!text.empty()) text = "\nWould be found nine times in ten from:\n" + text;
  if (!never.empty())
    text += report::Wrapped("At no strength that it can have so often: " + never + ".", "", "  ");
  return text;
}

std::string NumericsText(const Answer& answer) {
  std::string text;
  for (const NumericalChange& own : answer.numerics) {
    text += fmt::format("  {} from {} to {}: {} sd\n", own.name, Number(own.null, 3),
                        Number(own.tried, 3), Number(own.rms, 2));
  }
  return text.empty()
             ? text
             : "\nWhat should not matter moves the curves by, in sd of a measurement:\n" + text;
}

std::string RunsText(const Diagnosis& d) {
  if (d.design.empty()) {
    return d.answer.borrowed_runs == 0
               ? ""
               : fmt::format("By {} runs of the tables that have effects.\n",
                             d.answer.borrowed_runs);
  }
  std::string stages;
  int runs = 0;
  for (const auto& [stage, number] : d.answer.runs) {
    stages += fmt::format("{}{} {}", stages.empty() ? "" : ", ", stage, number);
    runs += number;
  }
  const std::string beside =
      d.borrowed.empty() ? ""
                         : fmt::format(", beside {} of {}", d.answer.borrowed_runs, d.borrowed);
  std::string text = fmt::format("{} runs{} in {}, {} model evaluations{}.\n", runs,
                                 stages.empty() ? "" : fmt::format(" ({})", stages), d.design,
                                 d.evaluations, beside);
  if (d.then && !d.then->campaign.empty()) {
    text += fmt::format("{} runs of {} in {}.\n", d.then->evaluations, InWords(d.then->plan),
                        d.then->campaign);
  }
  return text;
}

}  // namespace

std::string DiagnosisJson(const Diagnosis& d) {
  const Answer& answer = d.answer;
  Json candidates = Json::array();
  Json detectable = Json::object(), undetectable = Json::array();
  for (const EffectAnswer& own : answer.candidates) {
    candidates.push_back(CandidateJson(answer, own));
    if (own.visible.empty()) {
      undetectable.push_back({{"effect", own.effect},
                              {"reason",
                               "at no strength that it can have do these tests show it "
                               "nine times in ten"}});
    } else {
      detectable[own.effect] = own.visible;
    }
  }
  Json json = {{"campaign", d.campaign},
               {"verdict", ToString(answer.verdict)},
               {"effect", answer.effects.empty() ? Json(nullptr) : Json(answer.effects.front())},
               {"effects", answer.effects},
               {"candidates", candidates},
               {"not_excitable", ReasonsJson(answer.not_excitable)},
               {"next_experiment", NextJson(d.next_experiment)},
               {"model_evaluations", d.evaluations},
               {"adequacy",
                {{"chi2", answer.square},
                 {"degrees", answer.degrees},
                 {"p_value", answer.adequacy_p},
                 {"p_chi2", answer.p_square},
                 {"rms", answer.rms},
                 {"scatter", answer.scatter},
                 {"packings", d.packings}}}};
  json["only_adequacy"] = d.only_adequacy;
  json["units"] = d.units;
  json["sentence"] = Sentence(d);
  json["in_doubt"] = d.in_doubt;
  json["warnings"] = d.warnings;
  if (!d.only_adequacy) {
    json["probabilities"] = ProbabilitiesJson(answer);
    json["none_of_these"] = answer.none_of_these;
    json["log_evidences"] = EvidencesJson(answer);
    json["credible_set"] = CredibleSetJson(answer);
    json["families"] = FamiliesJson(answer);
    json["specimens"] = {{"repeat_names_alone", answer.repeat_names_alone}};
    json["detectable"] = detectable;
    json["undetectable"] = undetectable;
    json["design"] = {{"campaign", OrNull(d.design)}, {"runs", answer.runs}};
    if (!d.borrowed.empty()) {
      json["design"]["borrowed_from"] = d.borrowed;
      json["design"]["borrowed_runs"] = answer.borrowed_runs;
    } else if (d.design.empty()) {
      json["design"]["held_runs"] = answer.borrowed_runs;
    }
    json["numerics"] = NumericsJson(answer);
    json["without"] = d.left_out;
    json["then"] = ThenJson(d.then);
  }
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string DiagnosisText(const Diagnosis& d) {
  const Answer& answer = d.answer;
  std::string text = report::Wrapped(Sentence(d), "", "");
  text += report::Wrapped(
      fmt::format("Error of the best fit: {} sd; squared misfit {}, of a right model {} are "
                  "expected (p = {}).",
                  Number(answer.rms, 3), Number(answer.square, 4), Number(answer.degrees, 4),
                  Number(answer.adequacy_p, 2)),
      "", "");
  for (const std::string& warning : d.warnings) text += report::Wrapped(warning, "! ", "  ");
  if (!d.only_adequacy) {
    text += ModelsText(answer) + EffectsText(answer) + FamiliesText(answer);
    for (const EffectAnswer& own : answer.candidates) {
      if (own.probability < kDesignCaps.asked || own.amplitude.empty()) continue;
      text += report::Wrapped(fmt::format("{} fits best at {}.", own.effect,
                                          report::StrengthInWords(own.amplitude, d.units)),
                              "", "  ");
    }
    text += DetectableText(d) + NumericsText(answer);
  }
  text += ByReason("Not tried, because", answer.not_excitable);
  if (d.next_experiment) text += NextText(*d.next_experiment);
  return text + RunsText(d);
}

}  // namespace calib::diagnosis
