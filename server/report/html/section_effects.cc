#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

#include "server/report/html/sections.h"
#include "server/report/plot/plot.h"
#include "server/report/text/html.h"
#include "server/report/text/people_units.h"
#include "server/report/views/stored_diagnosis.h"

namespace calib::report {
namespace {

constexpr std::size_t kMostModels = 12;  // rows that are read at a glance; the rest is one row
constexpr double kBarWidth = 160;        // of probability one [px]

std::string JoinedForPeople(const std::vector<std::string>& effects, const char* between) {
  std::string text;
  for (const std::string& name : effects)
    text += (text.empty() ? "" : between) + NameForPeople(name);
  return text;
}

std::string ModelInWords(const std::vector<std::string>& effects) {
  if (effects.empty()) return "the model as it is";
  if (effects.front() == "other") return "all others together";
  if (effects.front() == "none_of_these") return "none of these";
  return JoinedForPeople(effects, " + ");
}

bool IsIn(const std::vector<std::vector<std::string>>& set,
          const std::vector<std::string>& effects) {
  return std::find(set.begin(), set.end(), effects) != set.end();
}

std::string ModelRow(const ProbableEffects& model, bool in_set) {
  return fmt::format(
      "<tr><td class=\"l\">{0}{1}{2}</td><td class=\"l\"><span class=\"bar\" "
      "style=\"width:{3:.0f}px\"></span> {4}</td><td>{5}</td></tr>\n",
      in_set ? "<strong>" : "", Escape(ModelInWords(model.effects)), in_set ? "</strong>" : "",
      std::max(1.0, kBarWidth * model.probability), Percent(model.probability, 3),
      in_set ? "yes" : "");
}

// Models by probability, none of these among them.
std::string ModelTable(const StoredDiagnosis& d) {
  std::vector<ProbableEffects> models = d.probabilities;
  models.push_back({.effects = {"none_of_these"}, .probability = d.none_of_these});
  const auto is_rest = [](const ProbableEffects& model) {
    return !model.effects.empty() && model.effects.front() == "other";
  };
  std::stable_sort(models.begin(), models.end(), [&](const auto& a, const auto& b) {
    return is_rest(a) != is_rest(b) ? is_rest(b) : a.probability > b.probability;
  });
  std::string html =
      "<h3>How probable each model is</h3>\n<div class=\"scroll\"><table><tr><th "
      "class=\"l\">effects that act</th><th class=\"l\">probability</th><th>in the 95&#8239;% "
      "set</th></tr>\n";
  double rest = 0;
  std::size_t shown = 0;
  for (const ProbableEffects& model : models) {
    const bool in_set = IsIn(d.credible_set, model.effects);
    if (is_rest(model) || (shown >= kMostModels && !in_set)) {
      rest += model.probability;
      continue;
    }
    html += ModelRow(model, in_set);
    ++shown;
  }
  if (rest > 0) html += ModelRow({.effects = {"other"}, .probability = rest}, false);
  return html + "</table></div>\n";
}

std::string FamilyList(const StoredDiagnosis& d) {
  std::string items;
  for (const ProbableEffects& family : d.families) {
    if (family.effects.size() < 2) continue;
    items += fmt::format("<li>{}: {}</li>\n", Escape(JoinedForPeople(family.effects, ", ")),
                         Percent(family.probability, 3));
  }
  if (items.empty()) return "";
  return "<p>Families, whose members these tests hardly tell apart or that are kin, and the "
         "probability that one of them acts:</p>\n<ul>\n" +
         items + "</ul>\n";
}

// The other members of the family that an effect is in.
std::string FamilyOf(const StoredDiagnosis& d, const std::string& effect) {
  for (const ProbableEffects& family : d.families) {
    const auto& names = family.effects;
    if (std::find(names.begin(), names.end(), effect) == names.end()) continue;
    std::vector<std::string> others;
    std::copy_if(names.begin(), names.end(), std::back_inserter(others),
                 [&effect](const std::string& name) { return name != effect; });
    return JoinedForPeople(others, ", ");
  }
  return "";
}

std::string EffectTable(const StoredDiagnosis& d) {
  std::string rows;
  for (const TriedEffect& tried : d.candidates) {
    rows += fmt::format(
        "<tr><td class=\"l\">{}{}{}</td><td>{}</td><td>{}</td><td>{}</td><td>{} → {}</td>"
        "<td>{}</td><td class=\"l wide\">{}</td><td class=\"l wide\">{}</td></tr>\n",
        tried.alone ? "<strong>" : "", Escape(NameForPeople(tried.effect)),
        tried.alone ? "</strong>" : "", tried.probability ? Percent(*tried.probability, 3) : "–",
        tried.alone ? "yes" : "", ShareExplained(tried.explained_fraction), Number(d.rms, 3),
        Number(tried.predicted_rms_error, 3), Number(tried.p_value, 2),
        Escape(OwnStrength(tried.effect, tried.amplitude, d.units)),
        Escape(FamilyOf(d, tried.effect)));
  }
  if (rows.empty()) return "";
  return "<h3>Effect by effect</h3>\n<div class=\"scroll\"><table><tr><th "
         "class=\"l\">effect</th><th>acts with probability</th><th>named</th><th>explains</th>"
         "<th>error, sd</th><th>p</th><th class=\"l\">strength</th><th "
         "class=\"l\">family</th></tr>\n" +
         rows +
         "</table></div>\n<p class=\"sub\">Explains and error, without → with: of the model with "
         "that effect alone at its posterior; share of the misfit beyond noise and scatter, root "
         "mean square of residual over the sd of a measurement. p: of the likelihood ratio against "
         "the model without it, not adjusted for the number of effects.</p>\n";
}

const EffectCurve* CurveOf(const TriedEffect& tried, const std::string& experiment,
                           const std::string& observable) {
  const auto found =
      std::find_if(tried.curves.begin(), tried.curves.end(), [&](const EffectCurve& curve) {
        return curve.experiment == experiment && curve.observable == observable;
      });
  return found == tried.curves.end() ? nullptr : &*found;
}

// What is missing of a curve, and what the effect would add to it, in sd of a measurement.
std::string ChangePlot(const ReportData& data, std::size_t e, std::size_t j,
                       const TriedEffect& tried, const EffectCurve& curve) {
  const campaign::Experiment& experiment = data.view.campaign.experiments[e];
  const campaign::MeasuredObservable& observable = experiment.observables[j];
  const ObservablePrediction& prediction = data.predictions[e].observables[j];
  const ControlAxis control = ControlOf(experiment);
  std::vector<double> missing, change;
  double largest = 3;
  const std::vector<Eigen::Index> read = campaign::RowsRead(observable);
  std::size_t next = 0;  // of the changes, which are those of rows that were read
  for (std::size_t i = 0; i < observable.values.size(); ++i) {
    const double sd = ErrorOf(data.view, observable, i);
    missing.push_back((observable.values[i] - prediction.mean[i]) / sd);
    const bool has = next < read.size() && next < curve.change.size() &&
                     read[next] == static_cast<Eigen::Index>(i);
    change.push_back(has ? curve.change[next++] / sd : std::nan(""));
    for (const double value : {missing.back(), change.back()}) {
      if (std::isfinite(value)) largest = std::max(largest, std::abs(value));
    }
  }
  Plot plot({.width = 330, .height = 150}, Axis::Covering(control.label, control.values),
            Axis("sd", -largest, largest, 3));
  plot.AddHorizontal(0);
  plot.AddPoints(control.values, missing, 2.4, "residual");
  plot.AddLine(control.values, change, "effect");
  const std::string of = experiment.name + ": " + NameForPeople(observable.name);
  return "<figure>\n" +
         plot.Svg(fmt::format("{}: what {} would change", of, NameForPeople(tried.effect)),
                  "points: measurement minus model over the sd of a measurement; line: what the "
                  "effect would add to the model") +
         "<figcaption>" + Escape(of) + "</figcaption>\n</figure>\n";
}

std::string ChangesOf(const ReportData& data, const StoredDiagnosis& d, const TriedEffect& tried) {
  std::string figures;
  const auto& experiments = data.view.campaign.experiments;
  for (std::size_t e = 0; e < experiments.size(); ++e) {
    if (experiments[e].role == campaign::Role::kValidate) continue;
    for (std::size_t j = 0; j < experiments[e].observables.size(); ++j) {
      const EffectCurve* curve =
          CurveOf(tried, experiments[e].name, experiments[e].observables[j].name);
      if (curve != nullptr) figures += ChangePlot(data, e, j, tried, *curve);
    }
  }
  if (figures.empty()) return "";
  const std::string family = FamilyOf(d, tried.effect);
  return fmt::format("<h4>{}{}; error {} → {} sd{}</h4>\n<div class=\"grid\">\n{}</div>\n",
                     Escape(NameForPeople(tried.effect)),
                     tried.probability ? ", " + Percent(*tried.probability, 3) : "",
                     Number(d.rms, 3), Number(tried.predicted_rms_error, 3),
                     family.empty() ? "" : "; like " + Escape(family) + " in these tests", figures);
}

}  // namespace

std::string EffectsSection(const ReportData& data, const StoredDiagnosis& diagnosis) {
  std::string html = ModelTable(diagnosis) + FamilyList(diagnosis) + EffectTable(diagnosis);
  if (diagnosis.repeat_names_alone) {
    html += fmt::format(
        "<p>The same tests on a second specimen would name one effect with probability {}.</p>\n",
        ChanceInWords(*diagnosis.repeat_names_alone));
  }
  std::string changes;
  if (ErrorsAreKnown(data.view)) {
    for (const TriedEffect& tried : diagnosis.candidates)
      changes += ChangesOf(data, diagnosis, tried);
  }
  if (changes.empty()) return html;
  return html +
         "<h3>What each effect would change</h3>\n<p class=\"sub\"><span class=\"key\" "
         "style=\"color:var(--model)\"></span>Points: measurement minus model, in sd of a "
         "measurement. <span class=\"key\" style=\"color:var(--good)\"></span>Line: the model with "
         "that effect minus the model without it, each at its posterior. What is missing is "
         "explained where the line follows the points.</p>\n" +
         changes;
}

}  // namespace calib::report
