#include "server/campaign/checks/test_start.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dem/particles/packing.h"
#include "dem/registry/catalog.h"

namespace calib::campaign {

std::optional<dem::Measurement> KnownStartOf(const Experiment& experiment) {
  const dem::TestInfo* test = dem::FindTest(experiment.test);
  const auto pressure = experiment.settings.find("confining_pressure");
  if (test == nullptr || !dem::InPeriodicCell(*test) || pressure == experiment.settings.end()) {
    return std::nullopt;
  }
  dem::Measurement start;
  start.axial_stress = start.lateral_stress = pressure->second;
  if (experiment.initial_stress) {
    start.axial_stress = experiment.initial_stress->axial;
    start.lateral_stress = experiment.initial_stress->lateral;
  }
  start.porosity = PorosityOfSpecimen(experiment);
  dem::DeriveReadings(start);
  return start;
}

double PorosityOfSpecimen(const Experiment& experiment) {
  /// Recipes from which on are clouds that consolidation closes [dem/particles/packing.h].
  constexpr double kCloud = 0.7;
  if (experiment.consolidation.porosity) return *experiment.consolidation.porosity;
  double porosity = std::numeric_limits<double>::quiet_NaN();
  if (experiment.specimens.empty()) return porosity;
  const Specimen& specimen = experiment.specimens.front();
  if (const auto* file = std::get_if<PackingFile>(&specimen)) {
    porosity = dem::PorosityOf(file->packing);
  } else if (const auto* recipe = std::get_if<dem::PackingRecipe>(&specimen)) {
    porosity = recipe->porosity;
  } else if (const auto* like = std::get_if<PackingLike>(&specimen)) {
    porosity = like->recipe.porosity;
  }
  return porosity < kCloud ? porosity : std::numeric_limits<double>::quiet_NaN();
}

double WayOf(const Experiment& experiment) {
  double way = 0;
  for (const double control : experiment.control) {
    way = std::max(way, std::abs(control - experiment.control_start));
  }
  return way;
}

double LargestSizeOf(const std::vector<double>& values) {
  double largest = 0;
  for (const double value : values) {
    if (std::isfinite(value)) largest = std::max(largest, std::abs(value));
  }
  return largest;
}

double SdAt(const MeasuredObservable& observable, std::size_t at) {
  const double sd = at < observable.sd.size() ? observable.sd[at] : 0;
  return std::isfinite(sd) ? sd : 0;
}

}  // namespace calib::campaign
