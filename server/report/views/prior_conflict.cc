#include "server/report/views/prior_conflict.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "dem/registry/catalog.h"
#include "server/messages/read_words.h"
#include "server/report/text/people_units.h"
#include "server/report/views/run_table.h"

namespace calib::report {
namespace {

using Eigen::Index;

constexpr double kFarOff = 3;    // sd
constexpr double kBeyond = 0.1;  // of the range of the runs
constexpr int kFewest = 2;       // readings of a stretch

// Histories of the first iteration, (prediction - reading) / sd.
Eigen::MatrixXd FirstRuns(const CampaignView& view, const inference::DataSet& units) {
  std::set<int> first;
  for (const v1::Sample& sample : view.samples) {
    if (sample.iteration() == 0 &&
        messages::PurposeOf(sample) == campaign::SamplePurpose::kEnsemble)
      first.insert(sample.index());
  }
  const RunTable runs = RunsOf(view, units);
  std::vector<Index> rows;
  for (std::size_t r = 0; r < runs.sample.size(); ++r) {
    if (first.count(runs.sample[r]) > 0) rows.push_back(static_cast<Index>(r));
  }
  return runs.histories(rows, Eigen::all);
}

// How far the reading lies beyond all runs: above zero where they are too low, below where they are
// too high; 0 where it is not clear of them.
double DistanceOf(const Eigen::VectorXd& runs) {
  const double margin = std::max(kFarOff, kBeyond * (runs.maxCoeff() - runs.minCoeff()));
  if (-runs.maxCoeff() > margin) return -runs.maxCoeff();
  if (runs.minCoeff() > margin) return -runs.minCoeff();
  return 0;
}

}  // namespace

std::vector<PriorConflict> PriorConflicts(const CampaignView& view) {
  std::vector<PriorConflict> conflicts;
  if (view.campaign.filter.noise != inference::NoiseMode::kGiven) return conflicts;
  const inference::DataSet units = ReadingsWithScatter(view).of_run;
  const Eigen::MatrixXd runs = FirstRuns(view, units);
  if (runs.rows() < kLeastRuns) return conflicts;
  for (const auto& [key, readings] : inference::GroupsOf(units)) {
    const campaign::Experiment& experiment =
        view.campaign.experiments[static_cast<std::size_t>(key.first)];
    PriorConflict stretch;
    const auto end = [&conflicts, &stretch] {
      if (stretch.readings >= kFewest) conflicts.push_back(stretch);
      stretch = {};
    };
    for (const int k : readings) {
      const double distance = DistanceOf(runs.col(k));
      if (stretch.readings > 0 && (distance == 0 || stretch.too_low != (distance > 0))) end();
      if (distance == 0) continue;
      const auto step =
          static_cast<std::size_t>(units.readings[static_cast<std::size_t>(k)].load_step);
      if (stretch.readings == 0) {
        stretch = {.experiment = experiment.name,
                   .observable = experiment.observables[static_cast<std::size_t>(key.second)].name,
                   .control_name = experiment.control_name,
                   .from = experiment.control[step],
                   .too_low = distance > 0};
      }
      stretch.to = experiment.control[step];
      stretch.nearest = std::max(stretch.nearest, std::abs(distance));
      ++stretch.readings;
    }
    end();
  }
  return conflicts;
}

std::string InWords(const PriorConflict& c) {
  const dem::ObservableInfo* control = dem::FindObservable(c.control_name);
  const auto along = [&](double value) {
    return NumberWithUnit(value, c.control_name, control != nullptr ? control->unit : "1", 3);
  };
  return fmt::format(
      "{}, {}: no parameters of the prior reach the {} readings from {} to {}: all runs of the "
      "first "
      "iteration are too {}, the nearest by {} sd. Widen the priors, or the model lacks something "
      "whatever its parameters.",
      c.experiment, NameForPeople(c.observable), c.readings, along(c.from), along(c.to),
      c.too_low ? "low" : "high", Number(c.nearest, 2));
}

}  // namespace calib::report
