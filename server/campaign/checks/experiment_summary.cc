#include "server/campaign/checks/experiment_summary.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>
#include <utility>

#include "server/campaign/checks/control_check.h"
#include "server/campaign/checks/test_start.h"

namespace calib::campaign {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

// Diameter below which half of the mass of these spheres is [m].
double MedianByMass(std::vector<double> radii) {
  std::sort(radii.begin(), radii.end());
  double all = 0;
  for (const double r : radii) all += r * r * r;
  double mass = 0;
  for (const double r : radii) {
    mass += r * r * r;
    if (mass >= 0.5 * all) return 2 * r;
  }
  return kNone;
}

double MedianOf(const dem::Grading& curve) {
  for (std::size_t i = 1; i < curve.size(); ++i) {
    if (curve[i].finer < 0.5) continue;
    const double part = (0.5 - curve[i - 1].finer) / (curve[i].finer - curve[i - 1].finer);
    const double ratio = std::log(curve[i].radius / curve[i - 1].radius);
    return 2 * curve[i - 1].radius * std::exp(part * ratio);
  }
  return kNone;
}

double MedianOf(const dem::PackingRecipe& recipe) {
  if (!recipe.radii.empty()) return MedianByMass(recipe.radii);
  if (!recipe.grading.empty()) return MedianOf(recipe.grading);
  // Radii uniform between a and b: the mass below r goes as r^4 - a^4.
  const double a = recipe.mean_radius * (1 - recipe.radius_spread);
  const double b = recipe.mean_radius * (1 + recipe.radius_spread);
  return 2 * std::pow(0.5 * (std::pow(a, 4) + std::pow(b, 4)), 0.25);
}

// Clumps count one.
int GrainsOf(const dem::Packing& packing) {
  int grains = 0;
  std::set<int> clumps;
  for (const int clump : packing.clump) {
    grains += clump < 0 || clumps.insert(clump).second ? 1 : 0;
  }
  return grains;
}

void DescribeSpecimen(const Experiment& experiment, ExperimentSummary& summary) {
  if (experiment.specimens.empty()) return;
  const Specimen& specimen = experiment.specimens.front();
  if (const auto* file = std::get_if<PackingFile>(&specimen)) {
    summary.grains = GrainsOf(file->packing);
    summary.d50 = MedianByMass(file->packing.radius);
  } else if (const auto* recipe = std::get_if<dem::PackingRecipe>(&specimen)) {
    summary.grains = recipe->particles;
    summary.d50 = MedianOf(*recipe);
  }
  summary.porosity = PorosityOfSpecimen(experiment);
}

// Smallest and largest of the numbers that there are.
std::pair<double, double> BoundsOf(const std::vector<double>& values) {
  double low = kNone;
  double high = kNone;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    low = std::isnan(low) ? value : std::min(low, value);
    high = std::isnan(high) ? value : std::max(high, value);
  }
  return {low, high};
}

}  // namespace

ObservableSummary SummaryOf(const MeasuredObservable& observable) {
  ObservableSummary summary;
  summary.name = observable.name;
  summary.unit = observable.unit;
  const std::vector<Eigen::Index> rows = RowsRead(observable);
  summary.readings = static_cast<int>(rows.size());
  summary.missing = static_cast<int>(observable.values.size()) - summary.readings;
  if (rows.empty()) return summary;
  summary.first = observable.values[static_cast<std::size_t>(rows.front())];
  summary.last = observable.values[static_cast<std::size_t>(rows.back())];
  std::tie(summary.min, summary.max) = BoundsOf(observable.values);
  std::vector<double> sd;
  for (const Eigen::Index row : rows) {
    if (!observable.sd.empty()) sd.push_back(observable.sd[static_cast<std::size_t>(row)]);
  }
  std::tie(summary.sd_min, summary.sd_max) = BoundsOf(sd);
  return summary;
}

ExperimentSummary SummaryOf(const Experiment& experiment) {
  ExperimentSummary summary;
  summary.name = experiment.name;
  summary.control = experiment.control_name;
  summary.control_unit = experiment.control_unit;
  if (!experiment.path.empty()) {
    summary.from = experiment.path.front().target;
    summary.to = experiment.path.back().target;
    summary.turning_points = experiment.control_name.empty() ? 0 : TurningPointsOf(experiment);
  }
  for (const MeasuredObservable& observable : experiment.observables) {
    summary.observables.push_back(SummaryOf(observable));
    if (!observable.values.empty()) {
      summary.observables.back().missing += experiment.rows_without_control;
    }
  }
  DescribeSpecimen(experiment, summary);
  return summary;
}

}  // namespace calib::campaign
