#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

#include "server/report/html/sections.h"
#include "server/report/plot/plot.h"
#include "server/report/text/html.h"
#include "server/report/views/residual_words.h"

namespace calib::report {
namespace {

std::string InWords(const std::vector<std::string>& effects) {
  std::string text;
  for (const std::string& name : effects) text += (text.empty() ? "" : " + ") + NameForPeople(name);
  return text.empty() ? "no effect" : text;
}

std::string Failures(const Comparison& comparison) {
  const std::vector<std::string> said = WhereItFails(comparison);
  if (said.empty()) {
    return comparison.p_value ? "<p>No stage of loading stands out.</p>\n" : "";
  }
  std::string html = "<ul>\n";
  for (const std::string& sentence : said) html += "<li>" + Escape(sentence) + "</li>\n";
  return html + "</ul>\n";
}

std::string DriftTable(const std::vector<ParameterDrift>& drifts) {
  std::string rows;
  for (const ParameterDrift& d : drifts) {
    for (const PartialFit& fit : d.fits) {
      rows += fmt::format(
          "<tr><td>{}</td><td class=\"l\">{}</td><td class=\"l\">{}</td><td>{} ± {}</td><td "
          "class=\"{}\">{}</td></tr>\n",
          Escape(NameForPeople(d.parameter)), Escape(fit.experiment),
          fit.segment.empty() ? "all" : Escape(NameForPeople(fit.segment)),
          Escape(NumberWithUnit(fit.mean, d.parameter, d.unit, 3)),
          Escape(NumberWithUnit(fit.sd, d.parameter, d.unit, 2)),
          std::abs(fit.z) > kClear ? "bad" : "", Number(fit.z, 2));
    }
  }
  if (rows.empty()) return "";
  return "<h3>Parameters fitted part by part</h3>\n<p class=\"sub\">What each parameter would be "
         "if "
         "only that experiment, or that stage of it, had been measured; z is the distance from the "
         "common value. A parameter that has to change is bent to hide something.</p>\n"
         "<div class=\"scroll\"><table><tr><th>parameter</th><th class=\"l\">experiment</th><th "
         "class=\"l\">stage</th><th>fitted alone</th><th>z</th></tr>\n" +
         rows + "</table></div>\n";
}

// Children below their parents, indented.
void AddBranch(const std::vector<Relative>& family, const std::string& parent,
               const std::string& shown, std::string& html) {
  html += "<ul>\n";
  for (const Relative& r : family) {
    if (r.parent != parent) continue;
    const std::string name = Escape(r.campaign + ": " + InWords(r.effects));
    html += fmt::format("<li>{}{}{}{}</li>\n", r.campaign == shown ? "<strong>" : "", name,
                        r.campaign == shown ? "</strong>" : "",
                        // Evidence of a first batch of a refit says nothing of the model.
                        r.purpose == campaign::DerivedFor::kWarmFit ? " (tried)"
                        : std::isfinite(r.log_evidence)
                            ? fmt::format(", log evidence {}", Number(r.log_evidence, 5))
                            : std::string());
    const bool has_children =
        std::any_of(family.begin(), family.end(),
                    [&r](const Relative& other) { return other.parent == r.campaign; });
    if (has_children) AddBranch(family, r.campaign, shown, html);
  }
  html += "</ul>\n";
}

std::string Tree(const ReportData& data) {
  if (data.story.family.size() < 2) return "";
  std::string html =
      "<h3>Models tried</h3>\n<p class=\"sub\">Each one is the one above with effects added; "
      "those that were only tried were refitted in small batches.</p>\n";
  AddBranch(data.story.family, data.story.family.front().parent, data.view.status.campaign(), html);
  return html;
}

const ImprovedModel* StepOf(const Story& story, const std::string& campaign) {
  if (!story.improvement) return nullptr;
  const auto& steps = story.improvement->steps;
  const auto found = std::find_if(steps.begin(), steps.end(), [&campaign](const auto& step) {
    return step.campaign == campaign;
  });
  return found == steps.end() ? nullptr : &*found;
}

// The models on the way with what the diagnosis of each said.
std::string StepTable(const Story& story) {
  const auto number = [](const std::optional<double>& error) {
    return error ? Number(*error, 3) : std::string("–");
  };
  // By improve alone.
  const bool left_out = story.improvement.has_value();
  std::string html = fmt::format(
      "<div class=\"scroll\"><table><tr><th>campaign</th><th class=\"l\">effects added</th>"
      "<th>error, sd</th>{}<th>held out</th><th class=\"l\">verdict</th></tr>\n",
      left_out ? "<th>left out</th>" : "");
  for (const ErrorStep& step : story.steps) {
    const StoredDiagnosis* d = LatestOf(story.diagnoses, step.campaign);
    const ImprovedModel* improved = StepOf(story, step.campaign);
    std::string verdict = d == nullptr ? "–" : NameForPeople(d->verdict);
    if (d != nullptr && !d->effect.empty()) verdict += ": " + NameForPeople(d->effect);
    html += fmt::format(
        "<tr><td>{}</td><td class=\"l\">{}</td><td>{}</td>{}<td>{}</td><td "
        "class=\"l\">{}</td></tr>\n",
        Escape(step.campaign), Escape(InWords(step.effects)), Number(step.rms_error, 3),
        left_out ? "<td>" + number(improved == nullptr ? std::nullopt : improved->left_out_error) +
                       "</td>"
                 : "",
        number(step.heldout_rms_error), Escape(verdict));
  }
  html += "</table></div>\n";
  if (!left_out) return html;
  return html +
         "<p class=\"sub\">Left out: each experiment of the fitted data, or each stage of a single "
         "one, predicted by a fit to the others.</p>\n";
}

// Why each effect was added and what spoke against others, as improve said it.
std::string Reasons(const Story& story) {
  if (!story.improvement) return "";
  std::string items;
  for (const ImprovedModel& step : story.improvement->steps) {
    if (!step.reason.empty())
      items += "<li>" + Escape(step.campaign + ": " + step.reason) + "</li>\n";
  }
  if (items.empty()) return "";
  std::string html = "<h3>Why each step</h3>\n<ul>\n" + items + "</ul>\n";
  if (story.improvement->verdict_digest.empty()) return html;
  html += fmt::format(
      "<p class=\"sub\">The verdict was kept, SHA-256 {}, before the held-out data were opened.",
      Escape(story.improvement->verdict_digest));
  if (const std::size_t before = story.improvement->opened_before.size(); before > 0) {
    html += fmt::format(" They had been opened before, for {}: who asks again has seen them.",
                        before == 1 ? "another verdict" : fmt::format("{} other verdicts", before));
  }
  return html + "</p>\n";
}

// Stage by stage, of the first model and the last.
std::string StageTable(const std::vector<ErrorStep>& steps) {
  std::string rows;
  for (const SegmentMisfit& after : steps.back().by_segment) {
    const auto& first = steps.front().by_segment;
    const auto before = std::find_if(first.begin(), first.end(), [&after](const SegmentMisfit& m) {
      return m.experiment == after.experiment && m.observable == after.observable &&
             m.segment == after.segment;
    });
    if (before == first.end()) continue;
    rows += fmt::format(
        "<tr><td>{}{}</td><td class=\"l\">{}</td><td "
        "class=\"l\">{}</td><td>{}</td><td>{}</td></tr>\n",
        Escape(after.experiment), after.heldout ? " (held out)" : "",
        Escape(NameForPeople(after.observable)), Escape(NameForPeople(after.segment)),
        Number(before->rms_error, 3), Number(after.rms_error, 3));
  }
  if (rows.empty()) return "";
  return "<h3>By loading stage</h3>\n<div class=\"scroll\"><table><tr><th>experiment</th><th "
         "class=\"l\">observable</th><th class=\"l\">stage</th><th>error before, "
         "sd</th><th>after</th></tr>\n" +
         rows + "</table></div>\n";
}

// Error against step, of the fitted data and, where they were opened, of the
// held-out ones.
struct ErrorCurve {
  std::vector<double> x, fitted, held_x, held;
};

ErrorCurve OfAll(const std::vector<ErrorStep>& steps) {
  ErrorCurve curve;
  for (const ErrorStep& step : steps) {
    curve.x.push_back(static_cast<double>(curve.x.size()));
    curve.fitted.push_back(step.rms_error);
    if (!step.heldout_rms_error) continue;
    curve.held_x.push_back(curve.x.back());
    curve.held.push_back(*step.heldout_rms_error);
  }
  return curve;
}

// Over the readings of all its experiments; none without any.
std::optional<double> ErrorOf(const ErrorStep& step, const std::string& observable, bool heldout) {
  if (heldout && !step.heldout_rms_error) return std::nullopt;
  double squares = 0;
  int readings = 0;
  for (const ObservableMisfit& m : step.by_observable) {
    if (m.observable != observable || m.heldout != heldout) continue;
    squares += m.readings * m.rms_error * m.rms_error;
    readings += m.readings;
  }
  return readings > 0 ? std::optional(std::sqrt(squares / readings)) : std::nullopt;
}

ErrorCurve OfObservable(const std::vector<ErrorStep>& steps, const std::string& observable) {
  ErrorCurve curve;
  for (std::size_t k = 0; k < steps.size(); ++k) {
    if (const auto error = ErrorOf(steps[k], observable, false)) {
      curve.x.push_back(static_cast<double>(k));
      curve.fitted.push_back(*error);
    }
    if (const auto error = ErrorOf(steps[k], observable, true)) {
      curve.held_x.push_back(static_cast<double>(k));
      curve.held.push_back(*error);
    }
  }
  return curve;
}

std::string ErrorPlot(const std::string& name, const ErrorCurve& curve, std::size_t steps) {
  std::vector<double> all = {0, 1};
  all.insert(all.end(), curve.fitted.begin(), curve.fitted.end());
  all.insert(all.end(), curve.held.begin(), curve.held.end());
  const int last = static_cast<int>(steps) - 1;
  Plot plot({.width = 330, .height = 190}, Axis("step", 0, last, last),
            Axis::Covering("error, sd", all, 5));
  plot.AddHorizontal(1);
  plot.AddLine(curve.x, curve.fitted, "mean");
  plot.AddPoints(curve.x, curve.fitted, 3.5);
  plot.AddLine(curve.held_x, curve.held, "mean held");
  plot.AddPoints(curve.held_x, curve.held, 3.5, "residual held");
  return "<figure>\n" +
         plot.Svg("Error of " + name + " against step",
                  "rms of residual over standard deviation of the fitted data and of the held-out "
                  "data") +
         "<figcaption>" + Escape(name) + "</figcaption>\n</figure>\n";
}

std::string ErrorChart(const Story& story) {
  const std::vector<ErrorStep>& steps = story.steps;
  if (steps.size() < 2) return "";
  std::vector<std::string> observables;
  for (const ObservableMisfit& m : steps.front().by_observable) {
    if (std::find(observables.begin(), observables.end(), m.observable) == observables.end()) {
      observables.push_back(m.observable);
    }
  }
  std::string html =
      "<h3>Error before and after</h3>\n<p class=\"sub\"><span class=\"key\" "
      "style=\"color:var(--model)\"></span>Fitted data; <span class=\"key\" "
      "style=\"color:var(--held)\"></span>held-out data, for the first and the last model. At one "
      "the model is as close as the errors let it be.</p>\n<div class=\"grid\">\n" +
      ErrorPlot("all observables", OfAll(steps), steps.size());
  if (observables.size() > 1) {
    for (const std::string& name : observables) {
      html += ErrorPlot(NameForPeople(name), OfObservable(steps, name), steps.size());
    }
  }
  html += "</div>\n" + StepTable(story) + Reasons(story) +
          "<h3>By observable</h3>\n<div class=\"scroll\"><table><tr><th>model</th><th "
          "class=\"l\">experiment</th><th "
          "class=\"l\">observable</th><th>error, sd</th></tr>\n";
  for (const ErrorStep& step : steps) {
    for (const ObservableMisfit& m : step.by_observable) {
      if (m.heldout && !step.heldout_rms_error) continue;
      html += fmt::format(
          "<tr><td>{}</td><td class=\"l\">{}{}</td><td class=\"l\">{}</td><td>{}</td></tr>\n",
          Escape(InWords(step.effects)), Escape(m.experiment), m.heldout ? " (held out)" : "",
          Escape(NameForPeople(m.observable)), Number(m.rms_error, 3));
    }
  }
  return html + "</table></div>\n" + StageTable(steps);
}

}  // namespace

std::string MissingPhysicsSection(const ReportData& data) {
  const std::string body = Failures(data.comparison) + DriftTable(data.story.drift) + Tree(data) +
                           ErrorChart(data.story);
  return body.empty() ? "" : "<h2>Where the model fails</h2>\n" + body;
}

}  // namespace calib::report
