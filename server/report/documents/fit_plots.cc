#include "server/report/documents/fit_plots.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "server/report/text/people_units.h"

namespace calib::report {
namespace {

constexpr int kRows = 9;          // of a plot's area: two plots and their axes fit 25 lines
constexpr int kResidualRows = 6;  // residuals are read for their sign and run

struct Drawn {
  const ExperimentCurves* experiment;
  const ObservableCurves* observable;
  double error;  // rms of the residuals; NaN: not known
};

double Largest(const std::vector<double>& values) {
  double largest = 0;
  for (const double value : values) {
    if (std::isfinite(value)) largest = std::max(largest, std::abs(value));
  }
  return largest;
}

double RmsOf(const std::vector<double>& residual) {
  double squares = 0;
  int count = 0;
  for (const double r : residual) {
    if (!std::isfinite(r)) continue;
    squares += r * r;
    ++count;
  }
  return count > 0 ? std::sqrt(squares / count) : std::nan("");
}

std::vector<double> Scaled(const std::vector<double>& values, double factor) {
  std::vector<double> scaled(values);
  for (double& value : scaled) value *= factor;
  return scaled;
}

std::string Label(const std::string& name, const DisplayUnit& unit) {
  return NameForPeople(name) + (unit.label.empty() ? "" : " [" + unit.label + "]");
}

struct Abscissa {
  std::vector<double> values;
  std::string label;
};

Abscissa AbscissaOf(const ExperimentCurves& e, std::size_t readings) {
  if (e.control.empty() || e.control_values.size() != readings) {
    Abscissa counted{.values = {}, .label = "reading"};
    for (std::size_t i = 1; i <= readings; ++i) counted.values.push_back(static_cast<double>(i));
    return counted;
  }
  const auto unit = UnitForPeople(e.control, e.control_unit, Largest(e.control_values));
  return {.values = Scaled(e.control_values, unit.factor), .label = Label(e.control, unit)};
}

// The median, else the mean, else the best run.
TerminalCurve ModelOf(const ExperimentCurves& e, const ObservableCurves& o) {
  const auto known = [](const std::vector<double>& values) { return Largest(values) > 0; };
  const std::vector<double>& median = o.prediction.bands[2];
  if (known(median)) return {.name = "model, median", .y = median};
  if (known(o.prediction.mean)) return {.name = "model", .y = o.prediction.mean};
  for (std::size_t i = 0; i < e.runs.size() && i < o.runs.size(); ++i) {
    if (e.runs[i].rank == 1) return {.name = "best run", .y = o.runs[i]};
  }
  return {};
}

std::string FitPlot(const Drawn& drawn, const TerminalStyle& style) {
  const ObservableCurves& o = *drawn.observable;
  const Abscissa x = AbscissaOf(*drawn.experiment, o.values.size());
  const auto unit = UnitForPeople(o.name, o.unit, Largest(o.values));
  std::vector<TerminalCurve> curves;  // the second has signs of its own where colours cannot tell
  TerminalCurve model = ModelOf(*drawn.experiment, o);
  if (!model.y.empty()) {
    model.x = x.values;
    model.y = Scaled(model.y, unit.factor);
    curves.push_back(std::move(model));
  }
  curves.push_back(
      {.name = "measured", .x = x.values, .y = Scaled(o.values, unit.factor), .joined = false});
  const std::string plot =
      TerminalPlot(curves, {.x = x.label, .y = Label(o.name, unit), .rows = kRows}, style);
  if (plot.empty()) return "";
  const std::string error =
      std::isfinite(drawn.error) ? fmt::format(": {} sd", Number(drawn.error, 3)) : "";
  return fmt::format("{}{}, {}{}\n", drawn.experiment->experiment,
                     drawn.experiment->heldout ? " (held out)" : "", NameForPeople(o.name), error) +
         plot;
}

std::string ResidualPlot(const ExperimentCurves& e, const TerminalStyle& style) {
  std::vector<TerminalCurve> curves;
  std::string label;
  for (const ObservableCurves& o : e.observables) {
    if (!std::isfinite(RmsOf(o.residual))) continue;
    Abscissa x = AbscissaOf(e, o.residual.size());
    label = x.label;
    curves.push_back(
        {.name = NameForPeople(o.name), .x = std::move(x.values), .y = o.residual, .joined = true});
  }
  if (curves.empty()) return "";
  return fmt::format("{}: model minus measurement [sd]\n", e.experiment) +
         TerminalPlot(curves, {.x = label, .y = "residual [sd]", .rows = kResidualRows}, style);
}

}  // namespace

std::string FitPlots(const std::vector<ExperimentCurves>& experiments, int most,
                     const TerminalStyle& style) {
  std::vector<Drawn> all;
  for (const ExperimentCurves& e : experiments) {
    for (const ObservableCurves& o : e.observables) {
      all.push_back({.experiment = &e, .observable = &o, .error = RmsOf(o.residual)});
    }
  }
  const auto worse = [](const Drawn& a, const Drawn& b) {
    return (std::isfinite(a.error) ? a.error : -1) > (std::isfinite(b.error) ? b.error : -1);
  };
  std::stable_sort(all.begin(), all.end(), worse);
  const auto shown = std::min(all.size(), static_cast<std::size_t>(std::max(0, most)));
  std::string text;
  for (std::size_t i = 0; i < shown; ++i) {
    const std::string plot = FitPlot(all[i], style);
    if (!plot.empty()) text += "\n" + plot;
  }
  if (text.empty()) return "";
  if (shown < all.size()) {
    text += fmt::format("\n{} more observables: calibctl page shows all\n", all.size() - shown);
  }
  for (std::size_t i = 0; i < experiments.size(); ++i) {
    const bool drawn = std::any_of(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(shown),
                                   [&](const Drawn& d) { return d.experiment == &experiments[i]; });
    const std::string plot = drawn ? ResidualPlot(experiments[i], style) : "";
    if (!plot.empty()) text += "\n" + plot;
  }
  return text;
}

}  // namespace calib::report
