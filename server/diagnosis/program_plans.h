#pragma once
// Planned tests of a program: those that its campaign names under `model.next`, and a fitted test
// again.

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "server/campaign/file/text/yaml_tree.h"
#include "server/client/laboratory.h"
#include "server/diagnosis/plan_screen.h"
#include "server/report/views/campaign_view.h"

namespace calib::diagnosis {

/// The entry of `experiments` that an experiment of a program is under this name, with data that
/// are still to come, in SI under our names.
campaign::YamlNode ProgramEntry(const campaign::Experiment& experiment, const std::string& name,
                                const std::string& file);

/// One of Campaign::next as a plan.
PlannedExperiment PlanOf(const campaign::Experiment& next);

/// The entry of a plan that follows an experiment of the campaign, or one of Campaign::next; empty:
/// the campaign file has no entry of that.
std::optional<campaign::YamlNode> EntryOfPlan(const report::CampaignView& base,
                                              const TestPlan& plan,
                                              const campaign::Experiment& pattern);

/// All of Campaign::next, in their order: nothing is screened, for their number is the user's
/// choice. Their data are what the run of sample `like` reads in them; a test that it does not end
/// is left out and told of in `warning`. Errors: those of the runs.
absl::StatusOr<PlanScreen> PlansOfProgram(client::Laboratory& laboratory,
                                          const report::CampaignView& base, int like);

}  // namespace calib::diagnosis
