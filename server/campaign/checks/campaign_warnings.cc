#include "server/campaign/checks/campaign_warnings.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "dem/registry/catalog.h"
#include "server/campaign/checks/control_check.h"
#include "server/campaign/checks/experiment_summary.h"
#include "server/campaign/checks/grain_check.h"
#include "server/campaign/checks/in_words.h"
#include "server/campaign/checks/noise_check.h"
#include "server/campaign/checks/run_table_check.h"
#include "server/campaign/checks/start_check.h"
#include "server/campaign/checks/test_ties.h"

namespace calib::campaign {
namespace {

void Add(const Experiment& experiment, WarningKind kind, const std::string& name,
         const std::string& message, std::vector<Warning>& warnings) {
  warnings.push_back({kind, experiment.name, name, message});
}

// Sd in the middle of the readings; NaN: none is stated.
double MedianSdOf(const MeasuredObservable& observable) {
  std::vector<double> sd;
  for (const Eigen::Index row : RowsRead(observable)) {
    if (!observable.sd.empty()) sd.push_back(observable.sd[static_cast<std::size_t>(row)]);
  }
  if (sd.empty()) return std::nan("");
  const auto middle = sd.begin() + static_cast<std::ptrdiff_t>(sd.size() / 2);
  std::nth_element(sd.begin(), middle, sd.end());
  return *middle;
}

// What the readings span: a curve its range; readings that do not form one, as repetitions, and
// one that stands alone, their size.
struct Extent {
  double size = 0;
  const char* words = "";
};
Extent ExtentOf(const Experiment& experiment, const ObservableSummary& summary) {
  const dem::TestInfo* test = dem::FindTest(experiment.test);
  const bool curve = summary.max > summary.min && (test == nullptr || !test->separate_points);
  if (curve) return {summary.max - summary.min, "the range of its readings"};
  return {std::max(std::abs(summary.min), std::abs(summary.max)),
          summary.readings == 1 ? "its reading" : "its readings"};
}

// An error as large as what the readings span.
void AddErrorSize(const Experiment& experiment, const MeasuredObservable& observable,
                  std::vector<Warning>& warnings) {
  const ObservableSummary summary = SummaryOf(observable);
  const double sd = MedianSdOf(observable);
  if (summary.readings == 0 || !std::isfinite(sd)) return;
  const Extent extent = ExtentOf(experiment, summary);
  if (extent.size > 0 && sd > extent.size) {
    Add(experiment, WarningKind::kErrorSize, observable.name,
        absl::StrCat("has a stated sd of ", InWords(observable.name, sd), ", larger than ",
                     extent.words, ", ", InWords(observable.name, extent.size),
                     ": see to its unit"),
        warnings);
  }
  const std::vector<double> travelled = TravelledControl(experiment, 0);
  const double path = travelled.empty() ? 0 : travelled.back();
  if (observable.values.size() > 1 && observable.correlation_length > path && path > 0) {
    Add(experiment, WarningKind::kErrorSize, observable.name,
        absl::StrCat("has a correlation_length of ",
                     InWords(experiment.control_name, observable.correlation_length),
                     ", longer than the whole path, ", InWords(experiment.control_name, path),
                     ": see to its unit"),
        warnings);
  }
}

void AddRedundant(const Experiment& experiment, std::vector<Warning>& warnings) {
  std::vector<std::string> names;
  for (const MeasuredObservable& observable : experiment.observables) {
    names.push_back(observable.name);
  }
  const auto ties =
      WhatTheyFollowFrom(experiment.test, experiment.settings, experiment.control_name, names);
  for (std::size_t k = 0; k < names.size(); ++k) {
    if (ties[k].empty()) continue;
    Add(experiment, WarningKind::kRedundant, names[k],
        absl::StrCat("follows from ", absl::StrJoin(ties[k], " and "), " in ", experiment.test,
                     ": compared as well it counts the same reading again, and the intervals come "
                     "out too narrow; keep one of them"),
        warnings);
  }
}

void AddFewGrains(const Campaign& campaign, const Experiment& experiment,
                  std::vector<Warning>& warnings) {
  for (const SpecimenRemarks& specimen :
       GrainRemarksOf(experiment, MiddleScenario(campaign, experiment))) {
    if (specimen.remarks.few.empty()) continue;
    Add(experiment, WarningKind::kFewGrains, experiment.observables.front().name,
        absl::StrCat("is read from ", specimen.grains, " grains",
                     specimen.path.empty() ? "" : " of " + specimen.path, ": ",
                     specimen.remarks.few),
        warnings);
    return;  // of other packings the same holds
  }
}

// A spread is not learnt from one label, and a batch may be read by nobody.
void AddLabels(const Campaign& campaign, std::vector<Warning>& warnings) {
  bool by_batch = false;
  for (const Population& population : campaign.populations) {
    by_batch = by_batch || population.per == Per::kBatch;
    std::set<std::string> fitted;
    for (const Experiment& experiment : campaign.experiments) {
      const std::string& label = LabelOf(population.per, experiment);
      const bool has = std::find(population.labels.begin(), population.labels.end(), label) !=
                       population.labels.end();
      if (has && experiment.role == Role::kCalibrate) fitted.insert(label);
    }
    if (fitted.size() > 1) continue;
    warnings.push_back({WarningKind::kLabels, "", population.name,
                        absl::StrCat("has one value among the fitted experiments",
                                     fitted.empty() ? "" : ", of " + *fitted.begin(),
                                     ": how far values lie apart cannot be learnt from one ",
                                     WordOf(kPerWords, population.per))});
  }
  for (const Experiment& experiment : campaign.experiments) {
    if (experiment.batch.empty() || by_batch) continue;
    warnings.push_back({WarningKind::kLabels, experiment.name, "",
                        absl::StrCat("batch: ", experiment.batch,
                                     " is read by no parameter; one with per: batch would")});
  }
}

}  // namespace

std::vector<Warning> WarningsOf(const Campaign& campaign) {
  std::vector<Warning> warnings;
  for (const Experiment& experiment : campaign.experiments) {
    for (Warning& warning : ControlWarnings(experiment)) warnings.push_back(std::move(warning));
    for (Warning& warning : StartWarnings(experiment)) warnings.push_back(std::move(warning));
    for (const MeasuredObservable& observable : experiment.observables) {
      AddErrorSize(experiment, observable, warnings);
    }
    if (campaign.precomputed || campaign.program) continue;
    AddRedundant(experiment, warnings);
    AddFewGrains(campaign, experiment, warnings);
  }
  AddLabels(campaign, warnings);
  for (Warning& warning : NoiseWarnings(campaign)) warnings.push_back(std::move(warning));
  for (Warning& warning : RunTableWarnings(campaign)) warnings.push_back(std::move(warning));
  return warnings;
}

}  // namespace calib::campaign
