#pragma once
// Which tests may tell models apart: among the tests of this build and a grid of their settings,
// those in which models at a few points each differ most. What they tell is next_experiment.h's.

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "dem/registry/catalog.h"
#include "server/campaign/file/text/yaml_tree.h"
#include "server/client/laboratory.h"
#include "server/diagnosis/test_plans.h"
#include "server/report/views/campaign_view.h"

namespace calib::diagnosis {

/// A model in the race at its best point. The view must outlive it.
struct Rival {
  std::string name{};  ///< of the effect; "base": the campaign's own model
  const report::CampaignView* view = nullptr;
  std::map<std::string, double> values{};             ///< calibrated parameters, SI
  std::vector<std::map<std::string, double>> near{};  ///< others that the readings do not exclude
  std::vector<std::string> effects{};                 ///< that join the model of the view, and
  /// ranges of their parameters, which are among the values.
  std::map<std::string, dem::DefaultPrior> parameters{};
};

/// Curves of a run of an experiment, [observable of the pattern][reading]; empty: it did not
/// finish.
std::vector<Eigen::VectorXd> CurvesOf(const report::CampaignView& view, const std::string& name,
                                      int sample, const campaign::Experiment& pattern,
                                      Eigen::Index readings);

/// What two runs differ by beyond what two runs of one model do, as a squared distance in units of
/// what a measurement and both runs scatter by; 0 where it is no more. departures: per curve, the
/// difference of the runs over the noise. scatter s of a single run in units of the noise: half of
/// its variance shifts a curve as a whole, half is from reading to reading. shift: per curve, sd of
/// what else may shift it as a whole, in units of the noise; empty: nothing does.
double SeparationOf(const std::vector<Eigen::VectorXd>& departures, double scatter,
                    const std::vector<double>& shift = {});

/// Two rivals in a planned test; means over their points.
struct RivalPair {
  std::string a, b;
  double distance = 0;  ///< sd of a measurement, >= 0
  double power = 0;     ///< chance to see it at the 1 % level
};

/// With less a pair is not told apart: ten times what is seen of two that are the same.
inline constexpr double kToldApart = 0.1;

/// Fills expected_power, distance and together of a plan.
void Weigh(const std::vector<RivalPair>& pairs, PlannedExperiment& planned);

/// Share of the pairs that is expected to be told apart.
double ShareToldApart(const std::vector<RivalPair>& pairs);

/// "None of these": the campaign's own model with a smooth misfit as large as the one that is
/// there.
struct NoneOfThese {
  Rival base{};
  /// By observable: rms of what it misses of the fitted readings beyond their noise, in units of
  /// it.
  std::map<std::string, double> missed{};
};

/// A test that was tried, and what it takes to run it.
struct ScreenedPlan {
  PlannedExperiment experiment{};
  std::vector<std::string> separates{};  ///< rivals that it tells from another
  campaign::YamlNode entry{};            ///< of `experiments`
  std::string file{};                    ///< of its data; as if it had been measured:
  std::string data{};                    ///< what the first rival reads at its best point
};

struct PlanScreen {
  std::vector<ScreenedPlan> plans{};  ///< best first
  std::int64_t evaluations = 0;
  std::string why_none{};  ///< a clause; empty where there are plans
  std::string warning{};   ///< a sentence without its full stop; may be empty
};

/// Runs every rival, and the model of `none`, once in every planned test, from the specimen and
/// seed of sample `like`, first with one thing changed at a time. The three best are run at the
/// rivals' other points too, and of these the best is chosen by what is expected over them; where
/// that does not tell 99 % of the pairs apart, the same with the best changes together (GridOf()).
/// Errors of a measurement: the noise that the campaign states for the observables at values of
/// their size, and `scatter` (of a single run, in units of that noise) for
/// the measurement and both runs: see SeparationOf(). None for fewer than two rivals, without a
/// known size of the errors, and where no plan is a campaign that this build accepts and is
/// finished by all rivals. Errors: those of the runs. The best is that which tells the most pairs
/// apart, and of equals the closest of them best; their distance from none of them is told beside
/// it.
absl::StatusOr<PlanScreen> ScreenPlans(client::Laboratory& laboratory,
                                       const std::vector<Rival>& rivals,
                                       const std::optional<NoneOfThese>& none, int like,
                                       double scatter);

}  // namespace calib::diagnosis
