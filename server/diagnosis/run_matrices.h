#pragma once
// Runs of a base campaign and of its design as the matrices that the numerical core learns from.
// Pure functions of what is stored; nothing in them is NaN.

#include <Eigen/Core>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/diagnosis/stage_coordinates.h"
#include "server/diagnosis/design_rows.h"
#include "server/diagnosis/history_scale.h"
#include "server/diagnosis/reading_effects.h"
#include "server/diagnosis/run_maker.h"
#include "server/report/views/campaign_view.h"

namespace calib::diagnosis {

/// How many groups of runs share no packing in any fitted experiment with another group: run i is
/// of group StreamOf(i) mod that. Experiments of 4 and 6 packings have 2, not 4; 1 where packings
/// were not varied.
int PackingsApart(const campaign::Campaign& campaign);

/// What the base campaign's runs are. Of twins (runs of one parameter vector where no fitted
/// experiment has a second packing) the first alone is among the n: what an emulator misses there
/// all of them share, so that they are one witness of it, and `twins` holds what they differ by.
struct BaseRuns {
  HistoryScale scale;
  bool elsewhere = false;  ///< another code made the runs: none can be added
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
  /// R x T: ScatteredReadings::twins as HistoryScale::Departures, zero where those are; no rows
  /// where no twins have parted.
  Eigen::MatrixXd twins{};
  /// T, in the order of `scale`, > 0: sd of a measurement about the model's mean history, scatter
  /// in it (ScatteredReadings::of_mean), over that of its noise; 1 where scatter was not measured.
  Eigen::VectorXd sd{};
};

/// Reads a finished campaign. Errors: FAILED_PRECONDITION with a sentence where the errors of its
/// readings are not stated.
absl::StatusOr<BaseRuns> BaseRunsOf(const report::CampaignView& view);

/// Scale and errors of a campaign's fitted tests, without runs; `sd` of the noise alone.
BaseRuns WithoutRuns(const campaign::Campaign& campaign);

/// Runs of a test that the base campaign does not have.
struct TestRuns {
  BaseRuns base;  ///< runs without effects; no twins, and `sd` of the noise alone
  std::vector<EndedBatch> batches{};  ///< the others
};

/// Reads the first `most` batches of a design of this test alone, whose data are in its file; runs
/// that verify are left out. rows: of its values. Errors: as BaseRunsOf and EndedBatchesOf.
absl::StatusOr<TestRuns> RunsOfTest(const report::CampaignView& design, const DesignRows& rows,
                                    int most);

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

/// The race with DesignEffect::calculated as the base's curves allow it: of all entries where the
/// runs were made elsewhere, else as long as some entry is run, since a design without runs is
/// none.
Race WithCalculated(const Race& race, const BaseRuns& base);

/// Those of the entries that are run.
std::vector<int> EntriesRun(const Race& race, const std::vector<int>& entries);

/// Runs of the base within its axes, and complete runs of the design with unchanged numerics and
/// only effects of the part; what numerics change, against the run without an effect that each
/// repeats; the base's twins; what calculated entries change of base runs, at strengths of the
/// reference prior.
inference::SetRuns SetRunsOf(const BaseRuns& base, const DesignRows& rows,
                             const std::vector<EndedBatch>& batches, const PartOfRace& part);

/// What each numerical choice changes of a history (HistoryScale::Scaled), by its number: the first
/// run with it against the same run without, where both came to their ends.
std::map<int, Eigen::VectorXd> ChangesByNumerics(const BaseRuns& base, const DesignRows& rows,
                                                 const std::vector<EndedBatch>& batches);

/// The columns of one experiment (HistoryScale::names) of these runs.
inference::SetRuns OfExperiment(const inference::SetRuns& runs, const HistoryScale& scale,
                                const std::string& experiment);

/// Complete runs of the design in which an entry is on, within the axes of the rows.
int RunsWith(const DesignRows& rows, const std::vector<EndedBatch>& batches, int entry);

/// Points of the kept entries alone, and points of all entries that have these.
inference::DesignPoints PartOfPoints(const DesignRows& rows, const PartOfRace& part,
                                     const inference::DesignPoints& points);
inference::DesignPoints WholePoints(const DesignRows& rows, const PartOfRace& part,
                                    const inference::DesignPoints& points);

}  // namespace calib::diagnosis
