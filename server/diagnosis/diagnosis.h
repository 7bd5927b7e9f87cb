#pragma once
// Which physical effect is missing in a calibrated model: the chain of adequacy test, screen and
// warm fits, each made of campaigns that are stored like any other.

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/diagnosis/screen.h"
#include "server/client/laboratory.h"
#include "server/diagnosis/next_experiment.h"
#include "server/diagnosis/strength_scale.h"

namespace calib::diagnosis {

struct CandidateEffect {
  std::string effect{};
  double p_value = 1;             ///< of the screen, adjusted for the number of candidates
  double explained_fraction = 0;  ///< of the misfit beyond noise and scatter
  double screen_explained = 0;    ///< the same before the refit
  std::map<std::string, double> amplitude{};  ///< parameter -> strength that explains it best [SI]
  double predicted_rms_error = 0;             ///< with the effect, as Diagnosis::rms
  std::string predicted_by = "screen";        ///< whose error that is: screen | refit
  std::vector<std::string> confusable_with{};
  // Of the warm fit, where there was one.
  std::string campaign{};                   ///< id
  std::map<std::string, double> closest{};  ///< all parameters of its closest run, SI
  double refit_p_value = -1;                ///< adequacy of the extended model
  double refit_chi2 = 0;
  inference::Advantage over_base{};
  std::optional<double> gain_p_value{};    ///< as in WarmFit
  std::optional<double> left_out_error{};  ///< see Diagnosis
  /// ln of the Bayes factor over the base model where the strength's prior is kStrengthScales times
  /// as wide; of those that explain the readings and are known well enough by an emulator.
  std::optional<ScaledEvidence> over_base_evidence{};
  std::map<std::string, double> angles{};  ///< to the other candidates, as in inference::Score
};

struct Diagnosis {
  std::string campaign{};
  std::string verdict;                      ///< adequate | missing_effect | ambiguous | unexplained
  std::string effect;                       ///< named, with missing_effect
  std::vector<CandidateEffect> candidates;  ///< best first
  std::vector<std::pair<std::string, std::string>> not_excitable;   ///< effect, why
  std::map<std::string, std::map<std::string, double>> detectable;  ///< effect -> parameter -> SI
  /// Effects that would not have been found at any strength that they can have, and why.
  std::vector<std::pair<std::string, std::string>> undetectable{};
  /// Named in the group although they do not explain the readings: their refits have not come to an
  /// end, so that they cannot be excluded.
  std::vector<std::string> unfinished{};
  std::string best_partial;  ///< with unexplained: the effect that helps most, if any does
  std::string reason{};  ///< with unexplained: why no effect is best_partial, or none explains it
  inference::Adequacy adequacy;
  /// Of the best fit, residual over the sd of a measurement: noise, and scatter between packings
  /// where it was measured.
  double rms = 0;
  /// rms of what the model misses of an experiment (or a stage, where there is one experiment) that
  /// it was not fitted to, in sd of a measurement; none where there is nothing to leave out.
  std::optional<double> left_out_error{};
  double emulator_error = 0, scatter = 0;
  int packings = 0;  ///< that the best estimate was run on; 0: scatter is that of single runs
  std::int64_t screen_evaluations = 0, warm_evaluations = 0;
  std::optional<NextExperiment> next_experiment;
  bool only_adequacy = false;  ///< no effect was tried
  /// What a numerical choice (the rate) changes of each fitted reading, in sd of the noise; none
  /// where there is no such choice. Not part of the JSON document.
  std::vector<Eigen::VectorXd> nuisance{};
  /// The errors are stated too small or too large by what the readings show, or readings are few:
  /// what is said rests on them.
  bool in_doubt = false;
  std::vector<std::string> warnings{};  ///< about noise, readings and packings, a sentence each
  std::map<std::string, std::string> units{};  ///< SI, of the strengths of effects
};

struct DiagnosisOptions {
  double level = 0.01;         ///< of the adequacy test and of the screen
  bool only_adequacy = false;  ///< no runs: says adequate or unexplained
  /// As measured for a model of the same readings; taken with only_adequacy, which measures none.
  std::vector<Eigen::VectorXd> nuisance = {};
  std::vector<std::string> without = {};  ///< effects that do not take part
  /// Of the screen and the warm fits together, on the fitted experiments; those that were made
  /// before count too.
  std::optional<std::int64_t> max_evaluations = {};
  bool next_experiment = true;  ///< where the model is not adequate: the test that separates rivals
};

/// Errors: FAILED_PRECONDITION with a sentence when nothing can be said (no posterior, noise not
/// given independently, runs made elsewhere); RESOURCE_EXHAUSTED when max_evaluations does not
/// suffice; those of the runs. Where the next experiment alone cannot be planned, a warning.
absl::StatusOr<Diagnosis> Diagnose(client::Laboratory& laboratory, const report::CampaignView& view,
                                   const DiagnosisOptions& options = {});

std::string DiagnosisJson(const Diagnosis& diagnosis);
std::string DiagnosisText(const Diagnosis& diagnosis);

}  // namespace calib::diagnosis
