#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dem/registry/catalog.h"
#include "server/messages/read_words.h"
#include "server/report/html/sections.h"
#include "server/report/plot/plot.h"
#include "server/report/text/html.h"

namespace calib::report {
namespace {

constexpr double kNinety = 1.645;  // sd, to 5 and 95 %
constexpr double kSignificant = 0.01;

std::vector<double> Scaled(std::vector<double> values, double factor) {
  for (double& value : values) value *= factor;
  return values;
}

double Largest(const std::vector<double>& values) {
  double largest = 0;
  for (const double value : values) {
    if (std::isfinite(value)) largest = std::max(largest, std::abs(value));
  }
  return largest;
}

DisplayUnit UnitOf(const std::string& observable, const std::vector<double>& values) {
  const dem::ObservableInfo* info = dem::FindObservable(observable);
  return UnitForPeople(observable, info != nullptr ? info->unit : "1", Largest(values));
}

constexpr int kTicks = 5;  // wanted along a curve's values

// Adds the ends of the bars that reach beyond the axis of what is shown by more than a plot's
// margin takes.
void MakeRoomFor(const std::vector<double>& measured, const std::vector<double>& sd,
                 std::vector<double>& shown) {
  constexpr double kMargin = 0.03;  // of the axis
  const Axis axis = Axis::Covering("", shown, kTicks);
  const double margin = kMargin * (axis.max() - axis.min());
  for (std::size_t i = 0; i < measured.size(); ++i) {
    if (measured[i] - sd[i] < axis.min() - margin) shown.push_back(measured[i] - sd[i]);
    if (measured[i] + sd[i] > axis.max() + margin) shown.push_back(measured[i] + sd[i]);
  }
}

std::string CurvePlot(const ReportData& data, std::size_t e, std::size_t j) {
  const campaign::Experiment& experiment = data.view.campaign.experiments[e];
  const campaign::MeasuredObservable& observable = experiment.observables[j];
  const ObservablePrediction& prediction = data.predictions[e].observables[j];
  const DisplayUnit unit = UnitOf(observable.name, observable.values);
  const ControlAxis control = ControlOf(experiment);
  const bool held = experiment.role == campaign::Role::kValidate;
  std::vector<double> sd;
  for (std::size_t i = 0; i < observable.values.size(); ++i) {
    sd.push_back(ErrorOf(data.view, observable, i) * unit.factor);
  }
  const std::vector<double> measured = Scaled(observable.values, unit.factor);
  std::vector<double> shown = measured;
  for (const auto* curve : {&prediction.mean, &prediction.q05, &prediction.q95}) {
    const std::vector<double> scaled = Scaled(*curve, unit.factor);
    shown.insert(shown.end(), scaled.begin(), scaled.end());
  }
  if (ErrorsAreKnown(data.view)) MakeRoomFor(measured, sd, shown);
  Plot plot({.bottom = 24}, Axis::Covering(control.label, control.values),
            Axis::Covering(LabelWithUnit(observable.name, unit), shown, kTicks));
  plot.HideLabels(true, false);
  const std::string css = held ? " held" : "";
  plot.AddBand(control.values, Scaled(prediction.q05, unit.factor),
               Scaled(prediction.q95, unit.factor), "band" + css);
  plot.AddLine(control.values, Scaled(prediction.mean, unit.factor), "mean" + css);
  if (ErrorsAreKnown(data.view)) plot.AddErrorBars(control.values, measured, sd);
  plot.AddPoints(control.values, measured, 2.6);
  return plot.Svg(fmt::format("{}: {}", experiment.name, NameForPeople(observable.name)),
                  "measured points with error bars, posterior mean as a line, 5 to 95 percent of "
                  "the posterior as a band");
}

std::string ResidualPlot(const ReportData& data, std::size_t e, std::size_t j) {
  const campaign::Experiment& experiment = data.view.campaign.experiments[e];
  const campaign::MeasuredObservable& observable = experiment.observables[j];
  const ObservablePrediction& prediction = data.predictions[e].observables[j];
  const ControlAxis control = ControlOf(experiment);
  const bool in_sd = ErrorsAreKnown(data.view);
  const DisplayUnit unit = UnitOf(observable.name, observable.values);
  std::vector<double> residual;
  double largest = in_sd ? 3 : 0;
  for (std::size_t i = 0; i < observable.values.size(); ++i) {
    const double scale = in_sd ? 1 / ErrorOf(data.view, observable, i) : unit.factor;
    residual.push_back((prediction.mean[i] - observable.values[i]) * scale);
    if (std::isfinite(residual.back())) largest = std::max(largest, std::abs(residual.back()));
  }
  const std::string label =
      in_sd ? "residual / sd" : "residual" + (unit.label.empty() ? "" : " (" + unit.label + ")");
  Plot plot({.height = 130}, Axis::Covering(control.label, control.values),
            Axis(label, -largest, largest, 3));
  for (const ObservableDiscrepancy& d : data.comparison.discrepancies) {
    if (d.experiment != experiment.name || d.observable != observable.name) continue;
    std::vector<double> low;
    std::vector<double> high;
    for (std::size_t i = 0; i < d.mean.size() && i < observable.values.size(); ++i) {
      const double scale = in_sd ? 1 / ErrorOf(data.view, observable, i) : unit.factor;
      low.push_back((d.mean[i] - kNinety * d.sd[i]) * scale);
      high.push_back((d.mean[i] + kNinety * d.sd[i]) * scale);
    }
    plot.AddBand(control.values, low, high, "band");
  }
  plot.AddHorizontal(0);
  if (in_sd) {
    plot.AddHorizontal(2);
    plot.AddHorizontal(-2);
  }
  plot.AddPoints(control.values, residual, 2.4,
                 experiment.role == campaign::Role::kValidate ? "residual held" : "residual");
  return plot.Svg(
      fmt::format("{}: residuals of {}", experiment.name, NameForPeople(observable.name)),
      in_sd ? "model minus measurement over the standard deviation of the error; dashed lines at 0 "
              "and plus "
              "and minus 2; as a band the smooth misfit beyond noise and scatter"
            : "model minus measurement");
}

std::string Caption(const ReportData& data, const std::string& experiment,
                    const std::string& observable) {
  for (const ObservableMisfit& misfit : data.comparison.by_observable) {
    if (misfit.experiment != experiment || misfit.observable != observable) continue;
    const dem::ObservableInfo* info = dem::FindObservable(observable);
    std::string text = fmt::format(
        "rms residual {} over {} readings",
        NumberWithUnit(misfit.rms_residual, observable, info != nullptr ? info->unit : "1", 3),
        misfit.readings);
    if (ErrorsAreKnown(data.view)) text += fmt::format(", {} sd", Number(misfit.rms_error, 3));
    if (misfit.p_value) text += fmt::format(", p = {}", Number(*misfit.p_value, 2));
    return text;
  }
  return "no predictions yet";
}

std::string ExperimentFigures(const ReportData& data, std::size_t e) {
  const campaign::Experiment& experiment = data.view.campaign.experiments[e];
  const bool held = experiment.role == campaign::Role::kValidate;
  std::string html =
      fmt::format("<h3>{}{}{}</h3>\n<div class=\"grid fit\">\n", Escape(experiment.name),
                  experiment.test.empty() ? "" : " – " + Escape(NameForPeople(experiment.test)),
                  held ? " (held out: not used for fitting)" : "");
  for (std::size_t j = 0; j < experiment.observables.size(); ++j) {
    html += "<figure>\n" + CurvePlot(data, e, j) + ResidualPlot(data, e, j) +
            fmt::format("<figcaption>{}: {}</figcaption>\n</figure>\n",
                        Escape(NameForPeople(experiment.observables[j].name)),
                        Escape(Caption(data, experiment.name, experiment.observables[j].name)));
  }
  return html + "</div>\n";
}

/// Root mean square of the errors stated for an observable [SI].
double RmsNoise(const CampaignView& view, const std::string& experiment,
                const std::string& observable) {
  double squares = 0;
  int readings = 0;
  for (const campaign::Experiment& e : view.campaign.experiments) {
    for (const campaign::MeasuredObservable& o : e.observables) {
      if (e.name != experiment || o.name != observable) continue;
      for (const Eigen::Index i : campaign::RowsRead(o)) {
        squares += std::pow(ErrorOf(view, o, static_cast<std::size_t>(i)), 2);
        ++readings;
      }
    }
  }
  return std::sqrt(squares / readings);
}

const v1::Posterior::Scatter* FindScatter(const v1::Posterior& posterior,
                                          const ObservableMisfit& misfit) {
  for (const v1::Posterior::Scatter& scatter : posterior.scatter()) {
    if (scatter.experiment() == misfit.experiment && scatter.observable() == misfit.observable &&
        scatter.sd_size() > 0) {
      return &scatter;
    }
  }
  return nullptr;
}

/// Root mean square of what runs of the model differ by [SI].
double RmsScatter(const v1::Posterior::Scatter& scatter) {
  double squares = 0;
  for (const double sd : scatter.sd()) squares += sd * sd;
  return std::sqrt(squares / scatter.sd_size());
}

std::string ScatterOrigin(const v1::Posterior::Scatter& scatter) {
  const auto source = messages::SourceOf(scatter);
  if (source == campaign::ScatterSource::kRealizations) {
    return fmt::format("{} packings", scatter.runs());
  }
  if (source == campaign::ScatterSource::kRepeats) return fmt::format("{} twins", scatter.runs());
  return fmt::format("emulator, {} runs", scatter.runs());
}

std::string ObservableTable(const ReportData& data) {
  if (data.comparison.by_observable.empty() || !ErrorsAreKnown(data.view)) return "";
  std::string html =
      "<h3>Misfit by observable</h3>\n<p class=\"sub\">Noise is the error stated for the "
      "measurement, scatter what runs of the model differ by among themselves, on other "
      "packings, as twins on one or as an emulator of them leaves it: root mean squares of their "
      "standard deviations. Twins are runs of the best estimate after the calibration whose "
      "parameters differ by a millionth: what is left between them is chance of one specimen. "
      "Both are part of sd in the error (root mean square of residual / sd) "
      "and in p, "
      "the scatter as far as the "
      "specimen has it too.</p>\n"
      "<div class=\"scroll\"><table><tr><th>experiment</th><th class=\"l\">observable</th>"
      "<th>readings</th><th>noise</th><th>scatter</th><th>scatter / noise</th>"
      "<th class=\"l\">from</th><th>residual</th><th>error, sd</th><th>p</th></tr>\n";
  for (const ObservableMisfit& misfit : data.comparison.by_observable) {
    const dem::ObservableInfo* info = dem::FindObservable(misfit.observable);
    const auto with_unit = [&](double value) {
      return Escape(
          NumberWithUnit(value, misfit.observable, info != nullptr ? info->unit : "1", 2));
    };
    const v1::Posterior::Scatter* const scatter = FindScatter(data.view.posterior, misfit);
    const double own = scatter == nullptr ? 0 : RmsScatter(*scatter);
    const double noise = RmsNoise(data.view, misfit.experiment, misfit.observable);
    html += fmt::format(
        "<tr><td>{}{}</td><td class=\"l\">{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>"
        "<td class=\"l\">{}</td><td>{}</td><td>{}</td><td class=\"{}\">{}</td></tr>\n",
        Escape(misfit.experiment), misfit.heldout ? " (held out)" : "",
        Escape(NameForPeople(misfit.observable)), misfit.readings, with_unit(noise),
        scatter == nullptr ? "–" : with_unit(own),
        scatter == nullptr ? "–" : Number(own / noise, 2),
        scatter == nullptr ? "not known" : ScatterOrigin(*scatter), with_unit(misfit.rms_residual),
        Number(misfit.rms_error, 3), misfit.p_value && *misfit.p_value < kSignificant ? "bad" : "",
        misfit.p_value ? Number(*misfit.p_value, 2) : "–");
  }
  return html + "</table></div>\n";
}

std::string SegmentTable(const ReportData& data) {
  if (data.comparison.by_segment.empty()) return "";
  std::string html =
      "<h3>Misfit by loading stage</h3>\n<p class=\"sub\">Bias is the mean of model minus "
      "measurement; z is the bias over its "
      "standard deviation. Beyond ±3 the model misses that stage by more than its errors "
      "explain.</p>\n"
      "<div class=\"scroll\"><table><tr><th>experiment</th><th class=\"l\">observable</th><th "
      "class=\"l\">stage</th><th>bias</th>"
      "<th>z</th><th>error, sd</th><th>p</th><th>share of the misfit</th><th "
      "class=\"l\">shape</th></tr>\n";
  for (const SegmentMisfit& segment : data.comparison.by_segment) {
    const dem::ObservableInfo* info = dem::FindObservable(segment.observable);
    const bool bad = segment.z && std::abs(*segment.z) > kClear;
    html += fmt::format(
        "<tr><td>{}{}</td><td class=\"l\">{}</td><td class=\"l\">{}</td><td>{}</td><td "
        "class=\"{}\">{}</td><td>{}</td><td>{}</td><td>{}</td><td class=\"l\">{}</td></tr>\n",
        Escape(segment.experiment), segment.heldout ? " (held out)" : "",
        Escape(NameForPeople(segment.observable)), Escape(NameForPeople(segment.segment)),
        Escape(NumberWithUnit(segment.bias, segment.observable, info != nullptr ? info->unit : "1",
                              3)),
        bad ? "bad" : "", segment.z ? Number(*segment.z, 3) : "–", Number(segment.rms_error, 3),
        segment.p_value ? Number(*segment.p_value, 2) : "–",
        segment.chi2_share ? Percent(*segment.chi2_share, 2) : "–",
        segment.pattern.shape == ResidualShape::kNone ? "" : ToString(segment.pattern.shape));
  }
  return html + "</table></div>\n";
}

}  // namespace

bool ErrorsAreKnown(const CampaignView& view) {
  return view.campaign.filter.noise != inference::NoiseMode::kEssTarget;
}

ControlAxis ControlOf(const campaign::Experiment& experiment) {
  if (experiment.control_name.empty()) return {experiment.control, "reading"};
  const DisplayUnit unit = UnitOf(experiment.control_name, experiment.control);
  return {Scaled(experiment.control, unit.factor), LabelWithUnit(experiment.control_name, unit)};
}

std::string FitSection(const ReportData& data) {
  std::string html = "<h2>Model against measurements</h2>\n<p class=\"sub\">Points: measured";
  html += ErrorsAreKnown(data.view) ? ", with one standard deviation of the error." : ".";
  html += fmt::format(
      "<span class=\"key\" style=\"color:var(--model)\"></span>{}."
      "<span class=\"key\" style=\"color:var(--held)\"></span>held out. Below each curve: model "
      "minus measurement{}.</p>\n",
      messages::SourceOf(data.view.posterior) == campaign::PosteriorSource::kNone
          ? "mean of the weighted samples, without a band since there is no posterior"
          : "posterior mean, shaded: 5&#8239;%&#8239;to&#8239;95&#8239;%",
      data.comparison.discrepancies.empty()
          ? ""
          : ", shaded: what of it is smooth misfit, beyond noise and scatter (5 to 95&#8239;%)");
  if (!data.comparison.note.empty()) {
    html += "<p class=\"sub\">" + Escape(data.comparison.note) + "</p>\n";
  }
  for (std::size_t e = 0; e < data.view.campaign.experiments.size(); ++e) {
    html += ExperimentFigures(data, e);
  }
  return html + ObservableTable(data) + SegmentTable(data);
}

}  // namespace calib::report
