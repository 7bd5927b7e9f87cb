#include "server/report/views/weighted_statistics.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace calib::report {
namespace {

bool Counts(double value, double weight) { return std::isfinite(value) && weight > 0; }

}  // namespace

double WeightedMean(std::span<const double> values, std::span<const double> weights) {
  double sum = 0;
  double total = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!Counts(values[i], weights[i])) continue;
    sum += weights[i] * values[i];
    total += weights[i];
  }
  return total > 0 ? sum / total : std::nan("");
}

double WeightedQuantile(std::span<const double> values, std::span<const double> weights,
                        double probability) {
  return WeightedQuantiles(values, weights, std::span(&probability, 1)).front();
}

std::vector<double> WeightedQuantiles(std::span<const double> values,
                                      std::span<const double> weights,
                                      std::span<const double> probabilities) {
  std::vector<std::pair<double, double>> sorted;
  double total = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!Counts(values[i], weights[i])) continue;
    sorted.emplace_back(values[i], weights[i]);
    total += weights[i];
  }
  std::sort(sorted.begin(), sorted.end());
  std::vector<double> quantiles;
  double below = 0;
  for (const auto& [value, weight] : sorted) {
    below += weight;
    while (quantiles.size() < probabilities.size() &&
           below >= probabilities[quantiles.size()] * total) {
      quantiles.push_back(value);
    }
  }
  quantiles.resize(probabilities.size(), sorted.empty() ? std::nan("") : sorted.back().first);
  return quantiles;
}

std::vector<double> WeightedHistogram(std::span<const double> values,
                                      std::span<const double> weights, double min, double max,
                                      int bins) {
  std::vector<double> density(static_cast<std::size_t>(bins), 0);
  double total = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!Counts(values[i], weights[i])) continue;
    const double position = (values[i] - min) / (max - min) * bins;
    const int bin = std::clamp(static_cast<int>(std::floor(position)), 0, bins - 1);
    density[static_cast<std::size_t>(bin)] += weights[i];
    total += weights[i];
  }
  const double width = (max - min) / bins;
  for (double& d : density) d = total > 0 ? d / (total * width) : 0;
  return density;
}

}  // namespace calib::report
