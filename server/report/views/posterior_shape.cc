#include "server/report/views/posterior_shape.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "server/messages/read_words.h"
#include "server/report/views/weighted_statistics.h"

namespace calib::report {
namespace {

constexpr std::size_t kMostDraws = 500;  // a corner plot shows no more
constexpr int kPoints = 101;
constexpr double kReach = 3;  // of a kernel, in widths

/// Weighted points of the posterior, one value per parameter.
struct Cloud {
  std::vector<std::vector<double>> points{};
  std::vector<double> weights{};
  double effective = 0;  ///< number of points, 1 / sum of squared weights
};

Cloud CloudOf(const v1::Posterior& posterior, std::size_t parameters,
              const std::vector<v1::Sample>& samples) {
  Cloud cloud;
  const auto source = messages::SourceOf(posterior);
  if (parameters == 0 || !source || *source == campaign::PosteriorSource::kNone) return cloud;
  const auto drawn = static_cast<std::size_t>(posterior.draws_size());
  for (std::size_t at = 0; at + parameters <= drawn; at += parameters) {
    const auto first = posterior.draws().begin() + static_cast<int>(at);
    cloud.points.emplace_back(first, first + static_cast<int>(parameters));
  }
  cloud.weights.assign(cloud.points.size(), 1);
  if (cloud.points.empty() && *source == campaign::PosteriorSource::kWeights) {
    for (const v1::Sample& sample : samples) {
      if (!(sample.weight() > 0)) continue;
      cloud.points.emplace_back(sample.parameters().begin(), sample.parameters().end());
      cloud.weights.push_back(sample.weight());
    }
  }
  double sum = 0;
  double squares = 0;
  for (const double w : cloud.weights) sum += w;
  for (double& w : cloud.weights) {
    w /= sum;
    squares += w * w;
  }
  cloud.effective = squares > 0 ? 1 / squares : 0;
  return cloud;
}

std::vector<std::vector<double>> Resampled(const Cloud& cloud) {
  if (cloud.points.empty()) return {};
  const std::size_t count = std::min(kMostDraws, cloud.points.size());
  std::vector<std::vector<double>> draws;
  double below = 0;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    below += cloud.weights[i];
    while (draws.size() < count &&
           (static_cast<double>(draws.size()) + 0.5) < below * static_cast<double>(count)) {
      draws.push_back(cloud.points[i]);
    }
  }
  return draws;
}

/// Where a curve is drawn, evenly in the standardised coordinate.
std::vector<double> Grid(double from, double to) {
  std::vector<double> grid;
  grid.reserve(kPoints);
  for (int k = 0; k < kPoints; ++k) grid.push_back(from + (to - from) * k / (kPoints - 1));
  return grid;
}

DensityCurve PriorCurve(const inference::Prior& prior, double from, double to) {
  DensityCurve curve;
  if (!(from < to) || !std::isfinite(from) || !std::isfinite(to)) return curve;
  for (const double s : Grid(prior.ToStandard(from), prior.ToStandard(to))) {
    const double x = std::clamp(prior.FromStandard(s), from, to);
    if (const double p = std::exp(prior.LogDensity(x)); std::isfinite(p)) curve.emplace_back(x, p);
  }
  return curve;
}

DensityCurve PosteriorCurve(const inference::Prior& prior, const Cloud& cloud, std::size_t j) {
  std::vector<double> at;
  at.reserve(cloud.points.size());
  for (const auto& point : cloud.points) {
    at.push_back(j < point.size() ? prior.ToStandard(point[j]) : std::nan(""));
  }
  const double mean = WeightedMean(at, cloud.weights);
  double variance = 0;
  for (std::size_t i = 0; i < at.size(); ++i) {
    if (std::isfinite(at[i])) variance += cloud.weights[i] * (at[i] - mean) * (at[i] - mean);
  }
  const std::vector<double> quartiles =
      WeightedQuantiles(at, cloud.weights, std::array{0.25, 0.75});
  const double range = (quartiles[1] - quartiles[0]) / 1.34;
  const double sd = std::sqrt(variance);
  const double width =
      0.9 * (range > 0 ? std::min(sd, range) : sd) * std::pow(cloud.effective, -0.2);
  if (!(width > 0)) return {};
  const double lower = std::isfinite(prior.min) ? prior.ToStandard(prior.min) : -HUGE_VAL;
  const double upper = std::isfinite(prior.max) ? prior.ToStandard(prior.max) : HUGE_VAL;
  const auto [least, most] = std::minmax_element(at.begin(), at.end());
  const double scale = 1 / (width * std::sqrt(2 * std::numbers::pi));
  DensityCurve curve;
  for (const double s :
       Grid(std::max(lower, *least - kReach * width), std::min(upper, *most + kReach * width))) {
    double density = 0;
    for (std::size_t i = 0; i < at.size(); ++i) {
      for (const double centre : {at[i], 2 * lower - at[i], 2 * upper - at[i]}) {
        const double z = (s - centre) / width;
        if (std::isfinite(z)) density += cloud.weights[i] * scale * std::exp(-z * z / 2);
      }
    }
    const double x = prior.FromStandard(s);
    curve.emplace_back(x, density * std::exp(prior.LogJacobian(x)));
  }
  return curve;
}

}  // namespace

PosteriorShape ShapeOf(const v1::Posterior& posterior,
                       std::span<const campaign::CalibratedParameter> parameters,
                       const std::vector<v1::Sample>& samples) {
  PosteriorShape shape;
  const Cloud cloud = CloudOf(posterior, parameters.size(), samples);
  shape.draws = Resampled(cloud);
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    const campaign::CalibratedParameter& parameter = parameters[j];
    shape.parameters.push_back(parameter.name);
    const auto record =
        std::find_if(posterior.parameters().begin(), posterior.parameters().end(),
                     [&parameter](const auto& p) { return p.name() == parameter.name; });
    const bool is_known = record != posterior.parameters().end();
    shape.prior.push_back(
        is_known ? PriorCurve(parameter.prior, record->prior_min(), record->prior_max())
                 : DensityCurve());
    const bool is_held = is_known && record->conditioned_on();
    shape.density.push_back(cloud.points.empty() || is_held
                                ? DensityCurve()
                                : PosteriorCurve(parameter.prior, cloud, j));
  }
  return shape;
}

}  // namespace calib::report
