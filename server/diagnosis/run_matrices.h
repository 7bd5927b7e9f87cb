#pragma once
// Runs of a base campaign and of its design as the matrices that the numerical core learns from.
// Pure functions of what is stored; nothing in them is NaN.

#include <Eigen/Core>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/diagnosis/stage_coordinates.h"
#include "server/diagnosis/design_rows.h"
#include "server/diagnosis/history_scale.h"
#include "server/diagnosis/run_maker.h"
#include "server/report/views/campaign_view.h"

namespace calib::diagnosis {

/// Readings (n x T, SI, in the order of the data) as they are with an effect whose parameter stands
/// at these values (n, SI): exact, what the grains do does not depend on it.
using CurveEffect =
    std::function<Eigen::MatrixXd(const Eigen::MatrixXd& readings, const Eigen::VectorXd& values)>;

/// What the base campaign's runs are.
struct BaseRuns {
  HistoryScale scale;
  std::map<std::string, CurveEffect> calculated{};  ///< by dotted name of the strength
  Eigen::MatrixXd values{};                         ///< n x d, SI
  Eigen::MatrixXd readings{};                       ///< n x T, SI, in the order of the data
  Eigen::MatrixXd histories{};                      ///< n x T, HistoryScale::Scaled
  std::vector<int> stream{};                        ///< n
  int packings = 1;         ///< packings that runs are spread over: stream modulo this is theirs
  int unfinished = 0;       ///< runs that did not come to their last reading: not among the n
  int samples = 0;          ///< of the campaign: streams of further runs begin here
  Eigen::MatrixXd noise{};  ///< T x T: covariance of the errors of histories
  double share = 1;         ///< largest ScatterShare of the fitted experiments
};

/// Reads a finished campaign. Errors: FAILED_PRECONDITION with a sentence where the errors of its
/// readings are not stated.
absl::StatusOr<BaseRuns> BaseRunsOf(const report::CampaignView& view);

/// Fewest base runs that an emulator which bends in all of d parameters is fitted to: four for each
/// coefficient of a quadratic, and ten more than coefficients (EffectFeatures::DegreeFor,
/// StageCoordinates::Fit).
int FewestBaseRuns(int parameters);

/// Entries of a race that take part in an emulator.
struct PartOfRace {
  std::vector<int> kept{};  ///< ascending; columns of strengths, in this order
  std::vector<int> flat{};  ///< that change nothing: runs that have them are runs without them
};

/// All entries.
PartOfRace WholeOf(const Race& race);

/// The race with DesignEffect::calculated as the base's curves allow it, as long as some entry is
/// run.
Race WithCalculated(Race race, const BaseRuns& base);

/// Those of the entries that are run.
std::vector<int> EntriesRun(const Race& race, const std::vector<int>& entries);

/// Runs of the base within its axes, and complete runs of the design with unchanged numerics and
/// only effects of the part; what numerics change, against the run of the base that each repeats;
/// what calculated entries change of base runs, at strengths of the reference prior.
inference::SetRuns SetRunsOf(const BaseRuns& base, const DesignRows& rows,
                             const std::vector<EndedBatch>& batches, const PartOfRace& part);

/// Complete runs of the design in which an entry is on.
int RunsWith(const DesignRows& rows, const std::vector<EndedBatch>& batches, int entry);

/// Points of the kept entries alone, and points of all entries that have these.
inference::DesignPoints PartOfPoints(const DesignRows& rows, const PartOfRace& part,
                                     const inference::DesignPoints& points);
inference::DesignPoints WholePoints(const DesignRows& rows, const PartOfRace& part,
                                    const inference::DesignPoints& points);

}  // namespace calib::diagnosis
