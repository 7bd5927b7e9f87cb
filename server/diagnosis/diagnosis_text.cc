#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "dem/registry/catalog.h"
#include "server/diagnosis/diagnosis.h"
#include "server/diagnosis/measurement_errors.h"
#include "server/diagnosis/plan_words.h"
#include "server/report/text/people_units.h"
#include "server/report/text/text_table.h"
#include "server/report/views/stored_diagnosis.h"

namespace calib::diagnosis {
namespace {

using Json = nlohmann::json;
using report::Number;

Json OrNull(const std::string& text) { return text.empty() ? Json(nullptr) : Json(text); }
Json OrNull(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

bool ComesCloser(const CandidateEffect& c) { return c.refit_p_value >= 0 && c.over_base.nats > 0; }

// Without the effect it is the base model: a refit that is further off has merely not been found.
// One that is calculated has been looked for at every strength.
bool NotFound(const CandidateEffect& c) {
  return !c.campaign.empty() && c.refit_p_value >= 0 && !ComesCloser(c);
}

// Tenths are more than their errors allow to tell.
std::string Nats(double value) { return fmt::format("{:.1f}", value); }

Json EvidenceJson(const std::optional<ScaledEvidence>& evidence) {
  if (!evidence) return nullptr;
  return {{"strength_prior_scale", kStrengthScales},
          {"log_bayes_factor", evidence->log_evidence},
          {"standard_error", evidence->standard_error}};
}

Json ReasonsJson(const std::vector<std::pair<std::string, std::string>>& list) {
  Json json = Json::array();
  for (const auto& [effect, reason] : list) {
    json.push_back({{"effect", effect}, {"reason", reason}});
  }
  return json;
}

Json CandidateJson(const CandidateEffect& c) {
  Json json = {{"effect", c.effect},
               {"p_value", c.p_value},
               {"explained_fraction", c.explained_fraction},
               {"amplitude", c.amplitude},
               {"predicted_rms_error", c.predicted_rms_error},
               {"predicted_by", c.predicted_by},
               {"confusable_with", c.confusable_with},
               {"angles", c.angles}};
  if (!c.campaign.empty()) {
    json["warm_fit"] = {{"campaign", c.campaign},
                        {"p_value", c.refit_p_value < 0 ? Json(nullptr) : Json(c.refit_p_value)},
                        {"chi2", c.refit_p_value < 0 ? Json(nullptr) : Json(c.refit_chi2)},
                        {"left_out_error", OrNull(c.left_out_error)},
                        {"advantage_nats", c.over_base.nats},
                        {"advantage_sd", c.over_base.sd},
                        {"gain_p_value", OrNull(c.gain_p_value)},
                        {"evidence", EvidenceJson(c.over_base_evidence)}};
  }
  return json;
}

Json PlannedJson(const PlannedExperiment& planned) {
  return {{"test", planned.test},
          {"settings", planned.settings},
          {"unloading", planned.unloading_at.has_value()},
          {"unloading_at", OrNull(planned.unloading_at)},
          {"control", planned.control},
          {"control_from", planned.path.front()},
          {"control_to", planned.path.back()},
          {"expected_power", planned.expected_power},
          {"distance_sd", planned.distance},
          {"points", planned.points},
          {"not_separated", planned.together},
          {"cost",
           {{"core_seconds_per_evaluation",
             planned.core_seconds > 0 ? Json(planned.core_seconds) : Json(nullptr)}}},
          {"none_of_these",
           {{"distance_sd", OrNull(planned.distance_from_none)},
            {"expected_power", OrNull(planned.power_against_none)}}}};
}

Json NextJson(const std::optional<NextExperiment>& next) {
  if (!next) return nullptr;
  Json json = PlannedJson(next->best);
  json["in_words"] = InWords(next->best);
  json["separates"] = next->separates;
  json["snippet"] = next->snippet;
  json["evaluations_for_planning"] = next->evaluations;
  json["considered"] = Json::array();
  for (const PlannedExperiment& planned : next->considered) {
    json["considered"].push_back(PlannedJson(planned));
  }
  return json;
}

// And from a misfit that none of them makes.
std::string AgainstNone(const PlannedExperiment& planned) {
  if (!planned.power_against_none) return "";
  return fmt::format(
      ", and them from a misfit of unknown cause as large as the present one with {} ({} sd)",
      report::Percent(*planned.power_against_none, 3), Number(*planned.distance_from_none, 3));
}

// Pairs of rivals that a planned test leaves together.
std::string NotTold(const PlannedExperiment& planned) {
  std::string text;
  for (const auto& [a, b] : planned.together) {
    text += fmt::format("{}{} from {}", text.empty() ? ", but not " : " nor ", a, b);
  }
  return text;
}

std::string CostOf(const PlannedExperiment& planned) {
  if (!(planned.core_seconds > 0)) return "";
  return fmt::format("; an evaluation costs about {} core seconds",
                     Number(planned.core_seconds, 2));
}

std::string NextText(const NextExperiment& next) {
  std::string names;
  for (const std::string& name : next.separates) names += (names.empty() ? "" : " and ") + name;
  std::string text =
      "\n" +
      report::Wrapped(
          fmt::format(
              "Next experiment: {}. It separates {} with a power of {} ({} sd apart){}{}{}. "
              "For the campaign file:",
              InWords(next.best), names, report::Percent(next.best.expected_power, 3),
              Number(next.best.distance, 3), NotTold(next.best), AgainstNone(next.best),
              CostOf(next.best)),
          "", "") +
      "\n" + next.snippet;
  if (next.considered.size() > 1) text += "\nAlso tried:\n";
  for (std::size_t k = 1; k < next.considered.size(); ++k) {
    const PlannedExperiment& planned = next.considered[k];
    text +=
        "  " + InWords(planned) + ": " +
        (planned.expected_power < kToldApart
             ? "tells none of them apart\n"
             : fmt::format("power {}, {} sd apart{}\n", report::Percent(planned.expected_power, 2),
                           Number(planned.distance, 3), NotTold(planned)));
  }
  return text;
}

std::string Listed(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
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

std::string VerdictInWords(const Diagnosis& d) {
  if (d.verdict == "adequate" && d.packings > 1 && d.packings < kFewestPackings) {
    return fmt::format(
        "Adequate, as far as {} packings tell, which is next to nothing: what is left may be "
        "scatter.",
        d.packings);
  }
  if (d.verdict == "adequate") {
    return "Adequate: noise, scatter and the emulator's error explain what is left.";
  }
  if (d.verdict == "missing_effect") {
    return fmt::format("Missing: {}. With it the model fits, and no other effect does as well.",
                       d.effect);
  }
  if (d.verdict == "ambiguous") {
    const CandidateEffect& first = d.candidates.front();
    std::string alike = first.effect;
    std::string open;
    for (const std::string& other : first.confusable_with) {
      const bool unfinished =
          std::find(d.unfinished.begin(), d.unfinished.end(), other) != d.unfinished.end();
      std::string& names = unfinished ? open : alike;
      names += (names.empty() ? "" : " or ") + other;
    }
    return fmt::format(
        "Ambiguous: {}.{}{}", open.empty() ? alike : alike + " or " + open,
        alike == first.effect ? "" : fmt::format(" These tests do not tell {} apart.", alike),
        open.empty()
            ? ""
            : fmt::format(
                  " Not excluded, since no refit has come to an end that shows what it can do: {}.",
                  open));
  }
  return fmt::format(
      "Unexplained: the model misses the data, and {}{}",
      d.reason.empty() ? "no effect was tried" : d.reason,
      d.best_partial.empty() ? "." : fmt::format("; {} helps most.", d.best_partial));
}

std::string Sentence(const Diagnosis& d) {
  return VerdictInWords(d) +
         (d.in_doubt ? " This is in doubt, for what the warnings say of the readings." : "");
}

// Of the effects that are named together, where the screen has measured both.
std::string GroupAngles(const Diagnosis& d) {
  const CandidateEffect& first = d.candidates.front();
  std::vector<std::string> group = first.confusable_with;
  group.insert(group.begin(), first.effect);
  std::vector<std::string> pairs;
  for (const CandidateEffect& c : d.candidates) {
    const auto at = std::find(group.begin(), group.end(), c.effect);
    if (at == group.end()) continue;
    for (auto other = group.begin(); other != at; ++other) {
      const auto angle = c.angles.find(*other);
      if (angle == c.angles.end()) continue;
      pairs.push_back(fmt::format("{} and {} {}°", *other, c.effect, Number(angle->second, 2)));
    }
  }
  if (pairs.empty()) return "";
  return report::Wrapped(
      fmt::format("Angle between what the tests see of them: {}.", fmt::join(pairs, ", ")), "",
      "  ");
}

}  // namespace

std::string DiagnosisJson(const Diagnosis& d) {
  Json candidates = Json::array();
  for (const CandidateEffect& c : d.candidates) candidates.push_back(CandidateJson(c));
  Json json = {{"campaign", d.campaign},
               {"verdict", d.verdict},
               {"effect", OrNull(d.effect)},
               {"candidates", candidates},
               {"not_excitable", ReasonsJson(d.not_excitable)},
               {"next_experiment", NextJson(d.next_experiment)},
               {"model_evaluations", d.screen_evaluations},
               {"warm_fit_evaluations", d.warm_evaluations},
               {"adequacy",
                {{"chi2", d.adequacy.chi2},
                 {"degrees", d.adequacy.degrees},
                 {"p_value", d.adequacy.p_value},
                 {"p_chi2", d.adequacy.p_chi2},
                 {"p_stages", OrNull(d.adequacy.p_shapes)},
                 {"rms", d.rms},
                 {"left_out_error", OrNull(d.left_out_error)},
                 {"emulator_error", d.emulator_error},
                 {"scatter", d.scatter},
                 {"packings", d.packings}}}};
  json["only_adequacy"] = d.only_adequacy;
  json["units"] = d.units;
  json["sentence"] = Sentence(d);
  json["in_doubt"] = d.in_doubt;
  json["warnings"] = d.warnings;
  if (d.verdict == "adequate") {
    json["detectable"] = d.detectable;
    json["undetectable"] = ReasonsJson(d.undetectable);
  }
  if (d.verdict == "ambiguous") json["unfinished"] = d.unfinished;
  if (d.verdict == "unexplained") {
    json["best_partial"] = OrNull(d.best_partial);
    json["reason"] = OrNull(d.reason);
  }
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string DiagnosisText(const Diagnosis& d) {
  std::string text = report::Wrapped(Sentence(d), "", "");
  text += report::Wrapped(
      fmt::format(
          "Error of the best fit: {} sd; chi-squared {}, of a right model {} are expected "
          "({}).",
          Number(d.rms, 3), Number(d.adequacy.chi2, 4), Number(d.adequacy.degrees, 4),
          report::PValuesInWords(d.adequacy.p_value, d.adequacy.p_chi2, d.adequacy.p_shapes)),
      "", "  ");
  for (const std::string& warning : d.warnings) text += report::Wrapped(warning, "! ", "  ");
  if (!d.candidates.empty()) {
    report::TextTable table(
        {"<effect", "p (screen)", "explains", "error with it", "refitted p", "left out"});
    for (const CandidateEffect& c : d.candidates) {
      table.AddRow({c.effect, Number(c.p_value, 2),
                    NotFound(c) ? "not found" : report::ShareExplained(c.explained_fraction),
                    Number(c.predicted_rms_error, 3),
                    c.refit_p_value < 0 || NotFound(c) ? "–" : Number(c.refit_p_value, 2),
                    c.left_out_error && !NotFound(c) ? Number(*c.left_out_error, 3) : "–"});
    }
    text += "\n" + table.ToString();
    if (std::any_of(d.candidates.begin(), d.candidates.end(), &NotFound)) {
      text += report::Wrapped(
          "Not found: the refit came no closer than the model without the effect, which it "
          "contains, before its runs were used up; more samples tell.",
          "", "");
    }
    if (std::any_of(d.candidates.begin(), d.candidates.end(), [&d](const CandidateEffect& c) {
          return !NotFound(c) && c.explained_fraction > 0 && c.predicted_rms_error > d.rms;
        })) {
      text += report::Wrapped(
          fmt::format(
              "Explains: share of the excess of chi-squared, which counts readings that err "
              "together (neighbours on one curve, the scatter of a packing) once. The error "
              "takes each reading alone: it may stay, or rise above the {} of the model "
              "without an effect, while chi-squared falls.",
              Number(d.rms, 3)),
          "", "");
    }
    if (d.left_out_error) {
      text += report::Wrapped(
          fmt::format("Left out: error on data that a model was not fitted to, one "
                      "experiment or stage after the other, in sd of a measurement; {} without any "
                      "of these effects.",
                      Number(*d.left_out_error, 3)),
          "", "");
    }
  }
  for (const CandidateEffect& c : d.candidates) {
    if (!ComesCloser(c)) continue;
    text += report::Wrapped(fmt::format("{} comes closest at {}.", c.effect,
                                        report::StrengthInWords(c.amplitude, d.units)),
                            "", "  ");
  }
  if (d.verdict == "ambiguous") text += GroupAngles(d);
  for (const CandidateEffect& c : d.candidates) {
    const bool named = d.verdict == "ambiguous" && &c == &d.candidates.front();
    if (c.confusable_with.empty() || named) continue;
    text += report::Wrapped(
        fmt::format("To the screen {} is like {}.", c.effect, Listed(c.confusable_with)), "", "  ");
  }
  for (const CandidateEffect& c : d.candidates) {
    if (!c.over_base_evidence) continue;
    const auto& nats = c.over_base_evidence->log_evidence;
    text += report::Wrapped(
        fmt::format("Log Bayes factor of {} over the model without it: {}, {}, {} where the prior "
                    "of its strength is a quarter, once and four times as wide.",
                    c.effect, Nats(nats[0]), Nats(nats[1]), Nats(nats[2])),
        "", "");
  }
  if (d.verdict == "adequate" && !d.detectable.empty()) {
    text += "\nWould have been found with 90 % power from:\n";
    for (const auto& [effect, strength] : d.detectable) {
      text += fmt::format("  {}: {}\n", effect, report::StrengthInWords(strength, d.units));
    }
  }
  if (d.verdict == "adequate") {
    text += ByReason("Would not have been found at any strength, because", d.undetectable);
  }
  text += ByReason("Not tried, because", d.not_excitable);
  if (d.next_experiment) text += NextText(*d.next_experiment);
  text += fmt::format("{} model evaluations for the screen, {} for warm fits.\n",
                      d.screen_evaluations, d.warm_evaluations);
  return text;
}

}  // namespace calib::diagnosis
