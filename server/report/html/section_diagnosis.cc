#include <fmt/format.h>

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "server/report/html/sections.h"
#include "server/report/text/html.h"
#include "server/report/text/people_units.h"
#include "server/report/views/stored_diagnosis.h"

namespace calib::report {
namespace {

std::string OrDash(const std::optional<double>& value, int digits) {
  return value ? Number(*value, digits) : "–";
}

// Of records of earlier rules.
std::string CandidateTable(const StoredDiagnosis& d) {
  if (d.candidates.empty()) return "";
  std::string html =
      "<div class=\"scroll\"><table><tr><th>effect</th><th>p (screen)</th><th>explains</th>"
      "<th>error with it</th><th>refitted p</th><th>left out</th><th class=\"l\">strength</th>"
      "<th class=\"l\">like (angle)</th></tr>\n";
  for (const TriedEffect& tried : d.candidates) {
    const bool named = tried.effect == d.effect;
    // Without the effect it is the base model: a refit further off has merely not been found.
    const bool not_found = tried.advantage_nats && *tried.advantage_nats <= 0;
    html += fmt::format(
        "<tr><td>{}{}{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>"
        "<td class=\"l wide\">{}</td><td class=\"l wide\">{}</td></tr>\n",
        named ? "<strong>" : "", Escape(NameForPeople(tried.effect)), named ? "</strong>" : "",
        Number(tried.p_value, 2),
        not_found ? "not found" : ShareExplained(tried.explained_fraction),
        Number(tried.predicted_rms_error, 3), not_found ? "–" : OrDash(tried.refit_p_value, 2),
        not_found ? "–" : OrDash(tried.left_out_error, 3),
        Escape(OwnStrength(tried.effect, tried.amplitude, d.units)), Escape(AlikeInWords(tried)));
  }
  html +=
      "</table></div>\n<p class=\"sub\">Best first. Explains: share of the misfit beyond noise "
      "and scatter; not found where the refit came no closer than the model without the effect "
      "before its runs were used up. Error: root mean square of residual over the sd of a "
      "measurement. Refitted: "
      "with all parameters free; a dash, where only the screen judged. Left out: error on data "
      "it was not fitted to";
  if (d.left_out_error) html += fmt::format(", {} without any", Number(*d.left_out_error, 3));
  return html + ". Effects less than 25° apart look alike in these tests.</p>\n";
}

std::string Reasons(const std::string& heading,
                    const std::vector<std::pair<std::string, std::string>>& list) {
  if (list.empty()) return "";
  std::map<std::string, std::string> by_reason;
  for (const auto& [effect, reason] : list) {
    std::string& names = by_reason[reason];
    names += names.empty() ? "" : ", ";
    names += NameForPeople(effect);
  }
  std::string html = "<h3>" + heading + "</h3>\n<ul>\n";
  for (const auto& [reason, names] : by_reason) {
    absl::StrAppend(&html, "<li>", Escape(absl::StrCat(names, ": ", reason)), ".</li>\n");
  }
  return html + "</ul>\n";
}

std::string Detectable(const StoredDiagnosis& d) {
  if (d.detectable.empty()) return "";
  std::string html =
      "<h3>What would have been found</h3>\n<p class=\"sub\">The smallest strength that these "
      "tests would have shown with 90 % power.</p>\n<ul>\n";
  for (const auto& [effect, strength] : d.detectable) {
    html += "<li>" + Escape(NameForPeople(effect) + ": " + OwnStrength(effect, strength, d.units)) +
            "</li>\n";
  }
  return html + "</ul>\n";
}

// What each measurement is expected to tell.
std::string ProposalsHtml(const StoredDiagnosis& d) {
  std::string html =
      "<h3>Next experiment</h3>\n<div class=\"scroll\"><table><tr><th class=\"l\">measurement</th>"
      "<th>one answer, and right</th><th>tells [bits]</th></tr>\n";
  for (const StoredProposal& own : d.proposals) {
    html += fmt::format("<tr><td class=\"l wide\">{}</td><td>{}</td><td>{}</td></tr>\n",
                        Escape(own.in_words), ChanceInWords(own.decides), Number(own.bits, 2));
  }
  return html +
         "</table></div>\n<p class=\"sub\">By runs of each test at what the models that lead "
         "leave open; the first for the campaign file:</p>\n<pre>" +
         Escape(d.next_experiment) + "</pre>\n";
}

std::string NextExperimentHtml(const StoredDiagnosis& d) {
  if (d.next_experiment.empty()) return "";
  if (!d.proposals.empty()) return ProposalsHtml(d);
  std::string names;
  for (const std::string& name : d.next_separates) {
    names += (names.empty() ? "" : " and ") + NameForPeople(name);
  }
  std::string together;
  for (const auto& [a, b] : d.next_together) {
    together += fmt::format("{}{} from {}", together.empty() ? ", but not " : " nor ",
                            NameForPeople(a), NameForPeople(b));
  }
  return fmt::format(
      "<h3>Next experiment</h3>\n<p>{}It separates {} with a power of {}{}. For the campaign "
      "file:</p>\n<pre>{}</pre>\n",
      d.next_in_words.empty() ? "" : Escape(d.next_in_words) + ". ", Escape(names),
      Percent(d.next_power, 3), Escape(together), Escape(d.next_experiment));
}

}  // namespace

std::string AlikeInWords(const TriedEffect& tried) {
  std::vector<std::pair<double, std::string>> alike;
  for (const std::string& other : tried.confusable_with) {
    const auto angle = tried.angles.find(other);
    alike.emplace_back(angle == tried.angles.end() ? 180 : angle->second, other);
  }
  std::sort(alike.begin(), alike.end());
  std::string text;
  for (const auto& [angle, other] : alike) {
    text += (text.empty() ? "" : ", ") + NameForPeople(other);
    if (angle < 180) text += fmt::format(" ({}°)", Number(angle, 2));
  }
  return text;
}

std::string OwnStrength(const std::string& effect, const std::map<std::string, double>& strength,
                        const std::map<std::string, std::string>& units) {
  std::map<std::string, double> values;
  std::map<std::string, std::string> own_units;
  for (const auto& [name, value] : strength) {
    const std::string own =
        NameForPeople(name.starts_with(effect + ".") ? name.substr(effect.size() + 1) : name);
    values[own] = value;
    if (const auto unit = units.find(name); unit != units.end()) own_units[own] = unit->second;
  }
  return StrengthInWords(values, own_units);
}

std::string DiagnosisSection(const ReportData& data) {
  const std::string& campaign = data.view.status.campaign();
  const StoredDiagnosis* d = LatestOf(data.story.diagnoses, campaign);
  if (d == nullptr) {
    return data.story.known
               ? "<h2>Which effect is missing</h2>\n<p>Not asked yet: <code>calibctl diagnose " +
                     Escape(campaign) + "</code> says whether one is.</p>\n"
               : "";
  }
  const bool by_earlier_rules = d->probabilities.empty() && !d->only_adequacy;
  std::string html = "<h2>Which effect is missing</h2>\n<p><strong>" +
                     Escape(d->sentence.empty() ? d->verdict : d->sentence) + "</strong></p>\n";
  if (by_earlier_rules) {
    html += "<p>By rules of an earlier build; <code>calibctl diagnose " + Escape(campaign) +
            "</code> asks again.</p>\n";
  }
  html += fmt::format(
      "<p>Error of the best fit: {} sd; chi-squared {}, of a right model {} are expected "
      "({}).{}</p>\n",
      Number(d->rms, 3), Number(d->chi2, 4), Number(d->degrees, 4),
      PValuesInWords(d->p_value, d->p_chi2, d->p_stages),
      d->only_adequacy ? " Whether an effect would fit better was not asked." : "");
  for (const std::string& warning : d->warnings) html += "<p>" + Escape(warning) + "</p>\n";
  html += by_earlier_rules ? CandidateTable(*d) : EffectsSection(data, *d);
  html += Detectable(*d) + Reasons("Not to be detected", d->undetectable) +
          Reasons("Not tried", d->not_excitable) + NextExperimentHtml(*d);
  return html + fmt::format("<p class=\"sub\">Diagnosis of {}, kept as SHA-256 {}.</p>\n",
                            DateForPeople(d->created_unix_ms), Escape(d->digest));
}

}  // namespace calib::report
