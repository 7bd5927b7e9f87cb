#pragma once
// The JSON documents that the command line prints and exports. NaN and infinities become null.

#include <span>
#include <string>
#include <vector>

#include "dem/formula/user_effect.h"
#include "server/campaign/checks/experiment_summary.h"
#include "server/campaign/checks/warning.h"
#include "server/campaign/file/parameters/setting_names.h"
#include "server/campaign/file/text/problem_list.h"
#include "server/campaign/model/campaign.h"
#include "server/report/views/campaign_view.h"
#include "server/report/views/comparison.h"
#include "server/report/views/curves.h"
#include "server/report/views/lineage.h"
#include "server/report/views/model_comparison.h"
#include "server/report/views/posterior_shape.h"
#include "server/report/views/sensitivity.h"

namespace calib::report {

/// parameters: of the campaign; where given, bounds that a prior does not have are null. shape: of
/// the posterior; without it there are no draws and densities.
std::string PosteriorJson(const v1::Posterior& posterior,
                          std::span<const campaign::CalibratedParameter> parameters = {},
                          const PosteriorShape& shape = {});
/// The fields of PosteriorJson() for a table that has run: what it has cost, everything else null
/// or empty.
std::string TablePosteriorJson(const v1::CampaignStatus& status);
std::string ComparisonJson(const std::string& campaign, const Comparison& comparison,
                           const std::vector<ExperimentCurves>& curves = {});
std::string SensitivityJson(const std::string& campaign, const Sensitivity& sensitivity);
std::string ModelsJson(const ModelComparison& comparison);
std::string StatusJson(const v1::CampaignStatus& status);
/// A campaign with what comes from it directly, what was concluded about it, the warnings of its
/// posterior and the command to go on with (NextCommand).
struct Shown {
  v1::CampaignStatus status{};
  std::vector<v1::CampaignStatus> children{};
  std::vector<v1::Finding> findings{};
  std::vector<std::string> warnings{};
  std::string next_command{};
};
std::string ShownJson(const Shown& shown);
std::string StatusListJson(const std::vector<v1::CampaignStatus>& statuses);
/// family: of the campaign, with the depth of each.
std::string LineageJson(const std::string& campaign, const std::vector<Branch>& family);
/// parameters: in the order of each sample's values.
std::string SamplesJson(const std::string& campaign,
                        std::span<const campaign::CalibratedParameter> parameters,
                        const std::vector<v1::Sample>& samples);
std::string StatesJson(const std::string& campaign, int sample,
                       const std::map<std::string, StateHistory>& by_experiment);
/// A table of states (experiment,load_step,...) row by row.
std::string StateTableJson(const std::string& csv);
std::string WorkersJson(const std::vector<v1::WorkerInfo>& workers);
/// What `validate` answers: problems, or of a campaign that is valid warnings, notes on what
/// follows without being said, what was read of each experiment, in people's units, and the names
/// that its parameters may have.
std::string ProblemsJson(const std::vector<campaign::Problem>& problems,
                         const std::vector<campaign::Warning>& warnings = {},
                         const std::vector<std::string>& notes = {},
                         const std::vector<campaign::ExperimentSummary>& experiments = {},
                         const std::vector<campaign::Calibratable>& calibratable = {});
/// The measurements as compared: SI, logarithmic strains, standard deviations.
std::string DataJson(const campaign::Campaign& campaign);

/// What this build offers.
std::string ContactsJson();
/// declared: effects of a campaign file, after those of the build.
std::string EffectsJson(std::span<const dem::UserEffect> declared = {});
std::string TestsJson();

}  // namespace calib::report
