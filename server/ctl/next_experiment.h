#pragma once
// Which test to do next: among the tests of this build and a grid of their settings, the one in
// which the models still in the race differ most.

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/ctl/laboratory.h"
#include "server/ctl/test_plans.h"
#include "server/report/campaign_view.h"

namespace calib::ctl {

/// A model in the race at its best point. The view must outlive it.
struct Rival {
  std::string name;  ///< of the effect; "base": the campaign's own model
  const report::CampaignView* view = nullptr;
  std::map<std::string, double> values;  ///< calibrated parameters, SI
};

struct NextExperiment {
  PlannedExperiment best;
  std::vector<std::string> separates;  ///< the rivals
  std::string snippet;  ///< an entry of `experiments`, indented, with a comment; the file of the
                        ///< measurement is to be made
  std::vector<PlannedExperiment> considered;  ///< best first
  std::int64_t evaluations = 0;
  double core_seconds = 0;  ///< of one evaluation, mean over what was tried
};

/// Runs every rival once in every planned test, from the specimen and seed of sample `like`. Errors
/// of a measurement: the noise that the campaign states for the observables at values of their
/// size, and `scatter` (of a single run, in units of that noise) for the measurement and both runs,
/// fully correlated along each curve. Empty: fewer than two rivals, no known size of the errors, or
/// nothing that all rivals finish. Errors: those of the runs.
absl::StatusOr<std::optional<NextExperiment>> PlanNextExperiment(Laboratory& laboratory,
                                                                 const std::vector<Rival>& rivals,
                                                                 int like, double scatter);

}  // namespace calib::ctl
