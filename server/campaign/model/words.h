#pragma once
// The closed sets of words by which campaigns and what belongs to them are described in campaign
// files, in the store, in messages and in documents.

#include <array>
#include <optional>
#include <string_view>

#include "dem/model/model.h"
#include "server/campaign/model/word_table.h"

namespace calib::campaign {

/// Of a campaign's model: what becomes of a shear force where its stiffness falls.
inline constexpr std::array kShearUnloadingWords = {
    Word{dem::ShearUnloading::kAsPublished, "as_published"},
    Word{dem::ShearUnloading::kRescaled, "rescaled"},
};

/// What the data of an experiment are for: the fit, or judging it.
enum class Role { kCalibrate, kValidate };
inline constexpr std::array kRoleWords = {
    Word{Role::kCalibrate, "calibrate"},
    Word{Role::kValidate, "validate"},
};

enum class CampaignState { kQueued, kRunning, kPaused, kFinished, kFailed, kCancelled };
inline constexpr std::array kCampaignStateWords = {
    Word{CampaignState::kQueued, "queued"}, Word{CampaignState::kRunning, "running"},
    Word{CampaignState::kPaused, "paused"}, Word{CampaignState::kFinished, "finished"},
    Word{CampaignState::kFailed, "failed"}, Word{CampaignState::kCancelled, "cancelled"},
};
const char* ToString(CampaignState state);
std::optional<CampaignState> ToCampaignState(std::string_view word);
/// True when nothing happens any more to a campaign in this state.
bool IsOver(CampaignState state);

/// What the runs of a campaign are made for: its posterior, then its held-out experiments.
enum class Phase { kCalibrating, kValidating, kDone };
inline constexpr std::array kPhaseWords = {
    Word{Phase::kCalibrating, "calibrating"},
    Word{Phase::kValidating, "validating"},
    Word{Phase::kDone, "done"},
};
const char* ToString(Phase phase);

/// Where one evaluation is, and in messages one sample, which is where its worst evaluation is.
/// kUnknown: a program failed on it as often as it may.
enum class EvaluationStatus {
  kWaiting,
  kRunning,
  kFinished,
  kDiverged,
  kStoppedEarly,
  kFailed,
  kUnknown
};
inline constexpr std::array kEvaluationStatusWords = {
    Word{EvaluationStatus::kWaiting, "waiting"},
    Word{EvaluationStatus::kRunning, "running"},
    Word{EvaluationStatus::kFinished, "finished"},
    Word{EvaluationStatus::kDiverged, "diverged"},
    Word{EvaluationStatus::kStoppedEarly, "stopped_early"},
    Word{EvaluationStatus::kFailed, "failed"},
    Word{EvaluationStatus::kUnknown, "unknown"},
};
const char* ToString(EvaluationStatus status);
/// True when nothing more is to be run for an evaluation in this status.
bool IsTerminal(EvaluationStatus status);

/// Why a sample is run. kEnsemble, whose word is the empty text: for the posterior, or as a row of
/// the campaign file. kScout and what follows: the stage of a design for which it was added.
enum class SamplePurpose {
  kEnsemble,
  kReplicate,
  kDraw,
  kScout,
  kMain,
  kSequential,
  kVerification,
  kNumerics
};
inline constexpr std::array kSamplePurposeWords = {
    Word{SamplePurpose::kEnsemble, ""},
    Word{SamplePurpose::kReplicate, "replicate"},
    Word{SamplePurpose::kDraw, "draw"},
    Word{SamplePurpose::kScout, "scout"},
    Word{SamplePurpose::kMain, "main"},
    Word{SamplePurpose::kSequential, "sequential"},
    Word{SamplePurpose::kVerification, "verification"},
    Word{SamplePurpose::kNumerics, "numerics"},
};
const char* ToString(SamplePurpose purpose);
/// True of the purposes that the runs added to a design have.
bool IsStageOfDesign(SamplePurpose purpose);

/// Why a campaign was derived from another, as verbs say it. A campaign file may give any other
/// text.
enum class DerivedFor {
  kExtension,
  kScreen,
  kNuisance,
  kWarmFit,
  kWarmFitBatch,
  kPrediction,
  kNextExperiment,
  kDesign
};
inline constexpr std::array kDerivedForWords = {
    Word{DerivedFor::kExtension, "extension"},
    Word{DerivedFor::kScreen, "screen"},
    Word{DerivedFor::kNuisance, "nuisance"},
    Word{DerivedFor::kWarmFit, "warm_fit"},
    Word{DerivedFor::kWarmFitBatch, "warm_fit_batch"},
    Word{DerivedFor::kPrediction, "prediction"},
    Word{DerivedFor::kNextExperiment, "next_experiment"},
    Word{DerivedFor::kDesign, "design"},
};
const char* ToString(DerivedFor purpose);
/// Empty for a purpose of a user's own, and where there is none.
std::optional<DerivedFor> ToDerivedFor(std::string_view word);

/// What a posterior follows from: its weighted samples, chains of tmcmc, draws on an emulator of
/// the runs, or none of these: then only the means of the weighted samples are known.
enum class PosteriorSource { kWeights, kTmcmc, kEmulator, kNone };
inline constexpr std::array kPosteriorSourceWords = {
    Word{PosteriorSource::kWeights, "weights"},
    Word{PosteriorSource::kTmcmc, "tmcmc"},
    Word{PosteriorSource::kEmulator, "emulator"},
    Word{PosteriorSource::kNone, "none"},
};
const char* ToString(PosteriorSource source);

/// What the scatter between packings was found from: runs on several packings, twins on the only
/// one, or what the emulator does not explain of single runs.
enum class ScatterSource { kRealizations, kRepeats, kEmulator };
inline constexpr std::array kScatterSourceWords = {
    Word{ScatterSource::kRealizations, "realizations"},
    Word{ScatterSource::kRepeats, "repeats"},
    Word{ScatterSource::kEmulator, "emulator"},
};

}  // namespace calib::campaign
