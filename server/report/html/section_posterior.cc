#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/messages/read_words.h"
#include "server/report/html/sections.h"
#include "server/report/plot/plot.h"
#include "server/report/text/html.h"
#include "server/report/views/weighted_statistics.h"

namespace calib::report {
namespace {

constexpr int kBins = 24;

// One parameter as it is drawn: prior range, scale and unit, and the samples.
struct ParameterPlot {
  std::string name, label;
  DisplayUnit unit;
  bool log = false;
  double min = 0, max = 1;      // as shown
  std::vector<double> samples;  // as shown, the runs
  std::vector<double> draws;    // as shown, equally weighted, of the posterior; else empty
  const inference::Prior* prior = nullptr;

  Axis MakeAxis(int ticks) const {
    return {label, min, max, ticks, log ? Axis::Scale::kLog : Axis::Scale::kLinear, true};
  }
};

std::vector<ParameterPlot> MakeParameterPlots(const CampaignView& view) {
  std::vector<ParameterPlot> plots;
  for (int k = 0; k < view.posterior.parameters_size(); ++k) {
    const auto& p = view.posterior.parameters(k);
    ParameterPlot plot;
    plot.name = p.name();
    plot.unit = ParameterUnit(p);
    plot.label = LabelWithUnit(p.name(), plot.unit);
    plot.prior = &view.campaign.parameters[static_cast<std::size_t>(k)].prior;
    plot.log = plot.prior->kind == inference::PriorKind::kLogUniform ||
               plot.prior->kind == inference::PriorKind::kLogNormal;
    plot.min = p.prior_min() * plot.unit.factor;
    plot.max = p.prior_max() * plot.unit.factor;
    for (const v1::Sample& sample : view.samples) {
      plot.samples.push_back(k < sample.parameters_size() ? sample.parameters(k) * plot.unit.factor
                                                          : std::nan(""));
    }
    for (int i = k; i < view.posterior.draws_size(); i += view.posterior.parameters_size()) {
      plot.draws.push_back(view.posterior.draws(i) * plot.unit.factor);
    }
    plots.push_back(std::move(plot));
  }
  return plots;
}

// Of the draws where there are any, else of the samples.
std::vector<double> Weights(const CampaignView& view) {
  if (view.posterior.draws_size() > 0) {
    return std::vector<double>(
        static_cast<std::size_t>(view.posterior.draws_size() / view.posterior.parameters_size()),
        1.0);
  }
  std::vector<double> weights;
  for (const v1::Sample& sample : view.samples) {
    weights.push_back(std::isfinite(sample.weight()) ? sample.weight() : 0);
  }
  return weights;
}

// The prior's range, or where the posterior is much narrower the part in which it lies.
std::pair<double, double> ShownRange(const std::vector<double>& values,
                                     const std::vector<double>& weights, double low, double high) {
  constexpr double kTail = 0.002;
  constexpr double kMargin = 0.2;  // of its width, on either side
  constexpr double kNarrow = 0.3;  // of the prior's range
  const double first = WeightedQuantile(values, weights, kTail);
  const double last = WeightedQuantile(values, weights, 1 - kTail);
  const double width = last - first;
  if (!(width > 0) || width > kNarrow * (high - low)) return {low, high};
  return {std::max(low, first - kMargin * width), std::min(high, last + kMargin * width)};
}

std::string Marginal(const ParameterPlot& parameter, const std::vector<double>& weights) {
  // Log parameters are counted in bins of equal ratio, so that a log-uniform prior is flat in the
  // picture.
  const auto coordinate = [&parameter](double value) {
    return parameter.log ? std::log(value) : value;
  };
  const auto back = [&parameter](double value) { return parameter.log ? std::exp(value) : value; };
  std::vector<double> values;
  for (const double value : parameter.draws.empty() ? parameter.samples : parameter.draws) {
    values.push_back(coordinate(value));
  }
  const auto [low, high] =
      ShownRange(values, weights, coordinate(parameter.min), coordinate(parameter.max));
  const std::vector<double> density = WeightedHistogram(values, weights, low, high, kBins);
  std::vector<double> edges;
  for (int i = 0; i <= kBins; ++i) edges.push_back(back(low + (high - low) * i / kBins));
  std::vector<double> prior_x;
  std::vector<double> prior_y;
  constexpr int kCurvePoints = 100;
  for (int i = 0; i <= kCurvePoints; ++i) {
    const double at = low + (high - low) * i / kCurvePoints;
    prior_x.push_back(back(at));
    const double si = back(at) / parameter.unit.factor;
    // Density per unit of the drawn coordinate.
    const double jacobian = parameter.log ? si : 1 / parameter.unit.factor;
    prior_y.push_back(std::exp(parameter.prior->LogDensity(si)) * jacobian);
  }
  double top = *std::max_element(density.begin(), density.end());
  for (const double h : prior_y) top = std::isfinite(h) ? std::max(top, h) : top;
  ParameterPlot shown = parameter;
  shown.min = back(low);
  shown.max = back(high);
  Plot plot({.width = 330, .height = 190, .left = 14, .right = 14}, shown.MakeAxis(5),
            Axis("", 0, 1.06 * top, 3, Axis::Scale::kLinear, true));
  plot.HideLabels(false, true);
  plot.AddColumns(edges, density);
  plot.AddLine(prior_x, prior_y, "prior");
  return "<figure>" +
         plot.Svg("posterior of " + NameForPeople(parameter.name),
                  "weighted histogram of the posterior over the prior's range; dashed line: prior "
                  "density") +
         "</figure>\n";
}

std::string Pair(const ParameterPlot& x, const ParameterPlot& y, const std::vector<double>& weights,
                 double correlation) {
  Plot plot({.width = 330, .height = 260}, x.MakeAxis(4), y.MakeAxis(4));
  plot.AddPoints(x.samples, y.samples, 1.1, "faint");
  if (x.draws.empty()) {
    plot.AddWeightedPoints(x.samples, y.samples, weights, 7);
  } else {
    plot.AddPoints(x.draws, y.draws, 1.4, "residual");
  }
  return "<figure>" +
         plot.Svg(NameForPeople(x.name) + " against " + NameForPeople(y.name),
                  x.draws.empty() ? "samples; area in proportion to posterior weight"
                                  : "runs as faint dots, draws from the posterior") +
         fmt::format("<figcaption>correlation {}</figcaption></figure>\n", Number(correlation, 2));
}

// What the posterior says of the fit and of the errors stated; empty: nothing.
std::string Checks(const v1::Posterior& posterior) {
  std::string items;
  if (posterior.has_predictive_p()) {
    items += fmt::format(
        "<li>Of data sets drawn from the posterior {} would fit no better than the measured ones "
        "(posterior predictive p-value {}). Near 0 the model misses more than the stated errors "
        "allow, near 1 these are stated too large.</li>\n",
        Percent(posterior.predictive_p(), 2), Number(posterior.predictive_p(), 2));
  }
  for (const auto& scale : posterior.noise_scale()) {
    items += fmt::format(
        "<li>Errors of {} are {} times as large as stated (5–95&#8201;%: {} to {}).</li>\n",
        Escape(fmt::format("{}", fmt::join(scale.observables(), ", "))), Number(scale.q50(), 2),
        Number(scale.q05(), 2), Number(scale.q95(), 2));
  }
  return items.empty() ? "" : "<h3>Fit and errors</h3>\n<ul>\n" + items + "</ul>\n";
}

}  // namespace

std::string PosteriorSection(const ReportData& data) {
  const std::vector<ParameterPlot> parameters = MakeParameterPlots(data.view);
  const std::vector<double> weights = Weights(data.view);
  const v1::Posterior& posterior = data.view.posterior;
  if (messages::SourceOf(posterior) == campaign::PosteriorSource::kNone) return "";
  const bool drawn = posterior.draws_size() > 0;
  const bool emulated = messages::SourceOf(posterior) == campaign::PosteriorSource::kEmulator;
  std::string html = fmt::format(
      "<h2>Posterior</h2>\n<p class=\"sub\">Columns: {} over the prior's range, or the part of it "
      "where a narrow posterior lies."
      "<span class=\"key\" style=\"color:var(--prior)\"></span>prior.</p>\n<div class=\"grid\">\n",
      emulated ? "draws from the posterior, sampled on an emulator of the runs,"
      : drawn  ? "draws from the posterior, one per chain,"
               : "weighted samples of all iterations");
  for (const ParameterPlot& parameter : parameters) html += Marginal(parameter, weights);
  html += "</div>\n" + Checks(posterior);
  if (parameters.size() < 2) return html;
  html += fmt::format(
      "<h3>Pairs</h3>\n<p class=\"sub\">Every run as a faint dot; {}.</p>\n<div class=\"grid\">\n",
      drawn ? "draws from the posterior in blue"
            : "the area of a blue disc is its posterior weight");
  const auto d = static_cast<int>(parameters.size());
  for (int i = 0; i < d; ++i) {
    for (int j = i + 1; j < d; ++j) {
      const int at = i * d + j;
      const double correlation = at < data.view.posterior.correlation_size()
                                     ? data.view.posterior.correlation(at)
                                     : std::nan("");
      html += Pair(parameters[static_cast<std::size_t>(i)], parameters[static_cast<std::size_t>(j)],
                   weights, correlation);
    }
  }
  return html + "</div>\n";
}

}  // namespace calib::report
