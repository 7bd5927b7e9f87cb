#pragma once
// Which measurement to make next: the one that is expected to tell most about which model is right,
// a repeat of a fitted test on another specimen among them.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/client/laboratory.h"
#include "server/diagnosis/design_stages.h"
#include "server/diagnosis/plan_screen.h"
#include "server/report/views/campaign_view.h"

namespace calib::diagnosis {

struct NextExperiment {
  PlannedExperiment best{};
  std::vector<std::string> separates{};  ///< models that it tells from another
  std::string snippet{};  ///< an entry of `experiments`, indented, with a comment; the file of the
                          ///< measurement is to be made
  /// All that were tried: those with a forecast first, by what they tell.
  std::vector<PlannedExperiment> considered{};
  std::int64_t evaluations = 0;
};

struct NextPlan {
  std::optional<NextExperiment> next{};
  std::string why_none{};               ///< a clause; empty where there is one
  std::vector<std::string> warnings{};  ///< a sentence each
};

/// Who is screened, as ScreenPlans takes them.
struct ScreenQuestion {
  std::vector<Rival> rivals{};
  std::optional<NoneOfThese> none{};
  int like = 0;
  double scatter = 0;
};

/// Screens plans by few runs of each rival (ScreenPlans). The two best get runs of their own
/// (RowsOfTest) at draws of the leading models' posteriors, rivals refitted and none of these among
/// them, and are told by inference::ExpectedInformation, as a repeat of each fitted test is by the
/// runs of the design; a plan whose emulator does not predict its own runs is not promised. The
/// best tells most. None where nothing tells as much as a further batch of the design has to
/// (DesignCaps::told). Errors: those of the runs.
absl::StatusOr<NextPlan> PlanNextExperiment(client::Laboratory& laboratory,
                                            const report::CampaignView& base,
                                            const AnsweredDesign& answered,
                                            const ScreenQuestion& question);

/// The proposal "a fitted test again, on another specimen". experiment: of the campaign.
PlannedExperiment RepeatOf(const campaign::Experiment& experiment);

}  // namespace calib::diagnosis
