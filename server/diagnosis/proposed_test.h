#pragma once
// A test that a campaign does not have, as the models that lead a diagnosis see it: which runs it
// takes, what is learnt from them, and whether that can be relied on. Pure.

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/diagnosis/diagnosis_set.h"
#include "inference/diagnosis/model_evidence.h"
#include "inference/diagnosis/next_measurement.h"
#include "server/diagnosis/design_stages.h"
#include "server/report/views/campaign_view.h"

namespace calib::diagnosis {

/// The models that a next measurement is to tell apart.
struct LeadingModels {
  std::vector<Eigen::Index> models{};  ///< among those asked, most probable first
  PartOfRace part{};                   ///< entries that they have
};

/// The most probable models, until they hold 99 %, at most twelve (inference::ForecastOptions).
LeadingModels LeadingOf(const AnsweredDesign& answered);

/// Rows that an emulator of the test is made by: at draws of the leading models some more without
/// effects than a plane through the base parameters has coefficients (StageCoordinates::Fit), and
/// kRunsOfTest with the models' own effects, more where models are many. made: rows that there are;
/// with some, the second number again at other draws. What the test's curves allow to be calculated
/// is not run.
inline constexpr int kRunsOfTest = 24;
std::vector<campaign::RunOf> RowsOfTest(const AnsweredDesign& answered,
                                        const LeadingModels& leading, const BaseRuns& test,
                                        int made);

/// What runs of the test say.
struct KnownTest {
  BaseRuns base;
  /// Of entries that two runs of the test have; z: what its file, or the base's, holds.
  Knowledge known;
  inference::PartOfColumns columns{};  ///< of these entries, among those of points of the kept ones
  std::vector<std::string> unknown{};  ///< effects of the leading models that too few runs have
  /// Each run is predicted by the others as well as is said (LeftOutHolds).
  bool holds = false;
};

/// Learns from the first batches of a design of the test. Errors: as RunsOfTest and
/// DiagnosisSet::Fit.
absl::StatusOr<KnownTest> LearnTest(const AnsweredDesign& answered, const LeadingModels& leading,
                                    const report::CampaignView& design, int batches);

/// Whether intervals of 90 % hold as many of the left-out runs: no fewer than two standard errors
/// below that, of as many independent numbers as there are runs.
bool LeftOutHolds(const inference::FeatureEmulator& emulator);

/// One of the base's fitted tests by itself, of all kept entries, by the runs that the design has:
/// what a repeat of it on another specimen is told by. Errors: those of DiagnosisSet::Fit.
absl::StatusOr<KnownTest> LearnRepeat(const AnsweredDesign& answered,
                                      const campaign::Campaign& base,
                                      const std::string& experiment);

/// What a measurement is expected to tell. Errors: those of inference::ExpectedInformation.
absl::StatusOr<inference::Forecast> ForecastOf(const AnsweredDesign& answered,
                                               const inference::ProposedMeasurement& proposed);

}  // namespace calib::diagnosis
