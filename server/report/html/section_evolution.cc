#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "server/messages/read_words.h"
#include "server/report/html/sections.h"
#include "server/report/plot/plot.h"
#include "server/report/text/html.h"

namespace calib::report {
namespace {

std::vector<double> Counting(std::size_t n) {
  std::vector<double> numbers;
  for (std::size_t i = 1; i <= n; ++i) numbers.push_back(static_cast<double>(i));
  return numbers;
}

constexpr int kMostTicks = 8;  // labels of more run into each other

// Mean and 5-95 % of one parameter after each iteration.
std::string OverIterations(const CampaignView& view, int k) {
  const auto& last = view.posterior.parameters(k);
  const DisplayUnit unit = ParameterUnit(last);
  std::vector<double> mean;
  std::vector<double> low;
  std::vector<double> high;
  for (const v1::Posterior& posterior : view.iterations) {
    if (k >= posterior.parameters_size()) continue;
    mean.push_back(posterior.parameters(k).mean() * unit.factor);
    low.push_back(posterior.parameters(k).q05() * unit.factor);
    high.push_back(posterior.parameters(k).q95() * unit.factor);
  }
  const std::vector<double> x = Counting(mean.size());
  std::vector<double> shown = mean;  // alone where no interval was given
  shown.insert(shown.end(), low.begin(), low.end());
  shown.insert(shown.end(), high.begin(), high.end());
  Plot plot({.width = 330, .height = 200},
            Axis("iterations", 0.7, static_cast<double>(x.size()) + 0.3,
                 std::min(static_cast<int>(x.size()), kMostTicks), Axis::Scale::kLinear, true),
            Axis::Covering(LabelWithUnit(last.name(), unit), shown, 4));
  plot.AddBand(x, low, high);
  plot.AddLine(x, mean);
  plot.AddPoints(x, mean, 3, "residual");
  return "<figure>" +
         plot.Svg(NameForPeople(last.name()) + " over the iterations",
                  "posterior mean and 5 to 95 percent after each iteration") +
         "</figure>\n";
}

// The first steps are as wide as the prior: the axis covers the band from a fifth of the path on
// with a quarter of its height beyond, and what lies beyond is drawn at its edge. The range of the
// axis.
std::vector<double> ShowLaterSteps(std::vector<double>& mean, std::vector<double>& low,
                                   std::vector<double>& high) {
  std::vector<double> shown = low;
  shown.insert(shown.end(), high.begin(), high.end());
  if (mean.empty()) return shown;
  const auto from = static_cast<std::ptrdiff_t>(mean.size() / 5);
  const double bottom = *std::min_element(low.begin() + from, low.end());
  const double top = *std::max_element(high.begin() + from, high.end());
  const double margin = 0.25 * (top - bottom);
  if (!std::isfinite(margin)) return shown;
  for (std::vector<double>* values : {&mean, &low, &high}) {
    for (double& value : *values) value = std::clamp(value, bottom - margin, top + margin);
  }
  return {bottom - margin, top + margin};
}

// Mean +- sd of one parameter while the readings are taken in one after the other.
using Path = google::protobuf::RepeatedPtrField<v1::Posterior::PathPoint>;

std::string AlongPath(const CampaignView& view, const Path& path, const std::string& axis, int k) {
  const auto& parameter = view.posterior.parameters(k);
  const DisplayUnit unit = ParameterUnit(parameter);
  std::vector<double> mean;
  std::vector<double> low;
  std::vector<double> high;
  for (const auto& point : path) {
    if (k >= point.mean_size() || k >= point.cov_size()) continue;
    const double sd = std::abs(point.mean(k)) * point.cov(k);
    mean.push_back(point.mean(k) * unit.factor);
    low.push_back((point.mean(k) - sd) * unit.factor);
    high.push_back((point.mean(k) + sd) * unit.factor);
  }
  const std::vector<double> x = Counting(mean.size());
  const std::vector<double> shown = ShowLaterSteps(mean, low, high);
  Plot plot({.width = 330, .height = 200},
            Axis(axis, 0, static_cast<double>(x.size()), 5, Axis::Scale::kLinear, true),
            Axis::Covering(LabelWithUnit(parameter.name(), unit), shown, 4));
  plot.AddBand(x, low, high);
  plot.AddLine(x, mean);
  return "<figure>" +
         plot.Svg(NameForPeople(parameter.name()) + " along the loading path",
                  "posterior mean plus and minus one standard deviation after each load step") +
         "</figure>\n";
}

std::string EssAlongPath(const CampaignView& view) {
  std::vector<double> ess;
  for (const auto& point : view.posterior.path()) ess.push_back(100 * point.ess());
  const std::vector<double> x = Counting(ess.size());
  Plot plot(
      {.width = 330, .height = 200},
      Axis("load steps taken in", 0, static_cast<double>(x.size()), 5, Axis::Scale::kLinear, true),
      Axis("effective sample size (%)", 0, 100, 5));
  plot.AddLine(x, ess);
  return "<figure>" +
         plot.Svg("effective sample size along the loading path",
                  "share of the samples that still count, in percent") +
         "</figure>\n";
}

// Rows of a table that a person reads; the chains of tmcmc take a hundred steps and more.
constexpr int kMostRows = 20;

// Every iteration, or evenly spaced ones with the first and the last.
std::vector<int> IterationsShown(int iterations) {
  std::vector<int> shown;
  const int rows = std::min(iterations, kMostRows);
  shown.reserve(static_cast<std::size_t>(rows));
  for (int row = 0; row < rows; ++row) {
    shown.push_back(rows == 1 ? 0 : row * (iterations - 1) / (rows - 1));
  }
  return shown;
}

std::string IterationTable(const CampaignView& view) {
  std::string html =
      "<div class=\"scroll\"><table><tr><th>after iteration</th><th>effective "
      "samples</th><th>Pareto index</th><th>log evidence</th>"
      "<th>model evaluations</th></tr>\n";
  for (const int k : IterationsShown(static_cast<int>(view.iterations.size()))) {
    const v1::Posterior& posterior = view.iterations[static_cast<std::size_t>(k)];
    const std::string evidence = std::isfinite(posterior.log_evidence())
                                     ? fmt::format("{} ± {}", Number(posterior.log_evidence(), 5),
                                                   Number(posterior.log_evidence_se(), 2))
                                     : "–";
    html += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                        posterior.iteration() + 1, Number(posterior.ess(), 3),
                        Number(posterior.pareto_k(), 2), evidence, posterior.model_evaluations());
  }
  return html + "</table></div>\n";
}

}  // namespace

std::string EvolutionSection(const ReportData& data) {
  const CampaignView& view = data.view;
  std::string html = "<h2>How the answer came about</h2>\n" + IterationTable(view);
  if (view.iterations.size() > 1) {
    html += "<h3>Over the iterations</h3>\n<div class=\"grid\">\n";
    for (int k = 0; k < view.posterior.parameters_size(); ++k) html += OverIterations(view, k);
    html += "</div>\n";
  }
  if (view.posterior.path_size() > 1) {
    html +=
        "<h3>Along the loading path</h3>\n<p class=\"sub\">What the readings say when they are "
        "taken in one load step after the "
        "other: a parameter that keeps drifting is asked to play different roles in different "
        "stages. The band is one standard deviation to either side; the first steps may reach "
        "beyond "
        "the plot, they are cut at its edge.";
    const bool emulated =
        messages::SourceOf(view.posterior) == campaign::PosteriorSource::kEmulator;
    if (emulated) {
      html += " On the emulator, like the posterior that it ends in.";
    } else if (messages::SourceOf(view.posterior) != campaign::PosteriorSource::kWeights) {
      html +=
          " By the weighted samples alone, few of which count at the end: look at the effective "
          "sample size beside.";
    }
    html += "</p>\n<div class=\"grid\">\n";
    for (int k = 0; k < view.posterior.parameters_size(); ++k) {
      html += AlongPath(view, view.posterior.path(), "load steps taken in", k);
    }
    if (!emulated) html += EssAlongPath(view);  // the emulator's draws are renewed on the way
    html += "</div>\n";
  }
  if (view.posterior.reversed_path_size() > 1) {
    html +=
        "<h3>Along the loading path, reversed</h3>\n<p class=\"sub\">The same readings taken in "
        "from the last to the first: what the end of the test says alone. Both orders end in the "
        "same posterior.</p>\n<div class=\"grid\">\n";
    for (int k = 0; k < view.posterior.parameters_size(); ++k) {
      html +=
          AlongPath(view, view.posterior.reversed_path(), "load steps taken in, from the last", k);
    }
    html += "</div>\n";
  }
  return html;
}

}  // namespace calib::report
