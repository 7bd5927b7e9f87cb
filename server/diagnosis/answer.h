#pragma once
// The answer by probabilities: from evidences of models to verdict, levels, families and words.
// Pure.

#include <Eigen/Core>
#include <array>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/diagnosis/effect_probabilities.h"
#include "server/campaign/model/campaign.h"
#include "server/campaign/model/words.h"

namespace calib::diagnosis {

enum class AnswerVerdict { kAdequate, kMissingEffect, kAmbiguous, kUnexplained };
inline constexpr std::array kVerdictWords = {
    campaign::Word{AnswerVerdict::kAdequate, "adequate"},
    campaign::Word{AnswerVerdict::kMissingEffect, "missing_effect"},
    campaign::Word{AnswerVerdict::kAmbiguous, "ambiguous"},
    campaign::Word{AnswerVerdict::kUnexplained, "unexplained"},
};
const char* ToString(AnswerVerdict verdict);

/// Enough for the first runs of its calibration with twenty parameters.
inline constexpr int kDrawsOfModel = 100;

/// A model by names; no effects: the base model.
struct NamedModel {
  std::vector<std::string> effects{};  ///< in the order of the race
  bool none_of_these = false;
  double probability = 0;
  /// Natural logarithm, under the reference prior, of the density of the coordinates of the
  /// measurement; its error, that of what the emulator does not know relative to the base model's
  /// in it. NaN: not asked for.
  double log_evidence = std::numeric_limits<double>::quiet_NaN();
  double log_evidence_se = std::numeric_limits<double>::quiet_NaN();
  /// Points of its posterior, the one that the measurement is most probable at first: parameters of
  /// the base and of the effects by dotted name, SI. Of models that are asked for alone.
  std::vector<std::map<std::string, double>> points{};
  /// Draws of the same parameters from its posterior, kDrawsOfModel evenly spaced.
  std::vector<std::map<std::string, double>> draws{};
  /// Mean and sd of them.
  std::map<std::string, campaign::FirstProposal::Place> posterior{};
  double rms = 0;  ///< of what its best point misses, in sd of a measurement
};

/// What an effect would change of one measured curve: the model with it at its best less the model
/// without at its own.
struct ChangedCurve {
  std::string experiment{}, observable{};
  std::vector<double> change{};  ///< at each reading, SI
};

/// What is said of one effect of the race.
struct EffectAnswer {
  std::string effect{};
  double probability = 0;  ///< that it acts, under the reference prior
  double uncertain = 0;    ///< sd of that over what the emulator does not know
  bool alone = false;
  /// Why it is not named though it is probable enough.
  std::optional<inference::NotNamed> not_named{};
  // Of the model with that effect alone, at its posterior:
  std::map<std::string, double> amplitude{};  ///< medians: dotted name -> SI
  /// Of the likelihood ratio against the model without, both with the errors of the latter;
  /// one-sided where the effect's sign is known, not adjusted for the number of effects or shapes;
  /// 1 where it comes no closer.                   [Chernoff, Ann. Math. Stat. 25 (1954) 573]
  double p_value = 1;
  double explained = 0;                ///< share of the squared error beyond one sd, 0 to 1
  double rms = 0;                      ///< of what it misses, in sd of a measurement
  std::vector<ChangedCurve> curves{};  ///< where it is probable enough to be asked for
  /// Smallest strengths that a measurement shows nine times in ten (lambda = 21), where there are
  /// such: dotted name -> SI.
  std::map<std::string, double> visible{};
  std::map<std::string, double> angles{};  ///< to the others, degrees
};

/// What a setting changes that should not matter.
struct NumericalChange {
  std::string name{};          ///< as a design calls it
  double null = 0, tried = 0;  ///< SI
  double rms = 0;              ///< of the change, in sd of a measurement
};

struct NamedFamily {
  std::vector<std::string> effects{};
  double probability = 0;
};

/// The answer.
struct Answer {
  AnswerVerdict verdict = AnswerVerdict::kAmbiguous;
  std::vector<std::string> effects{};       ///< named, most probable first
  bool sure = false;                        ///< all of them at AnswerLevels::sure
  std::vector<NamedModel> probabilities{};  ///< largest first; they sum to one
  double adequate = 0;                      ///< probability of the base model
  double none_of_these = 0;
  std::vector<NamedModel> credible_set{};  ///< the fewest models that hold AnswerLevels::set
  std::vector<NamedFamily> families{};     ///< at AnswerLevels::family
  std::vector<EffectAnswer> candidates{};  ///< those of the credible set first, then by probability
  double adequacy_p = 1;                   ///< chance of the base model's misfit
  double square = 0, degrees = 0;          ///< of that misfit in the coordinates; its expectation
  double p_square = 1;                     ///< chance of a square as large
  double rms = 0;  ///< of what the base model misses, in sd of a measurement
  /// The same by observable beyond the noise, in sd of that.
  std::map<std::string, double> missed{};
  double scatter = 0;  ///< of a single run, in sd of the noise of the coordinates
  /// Chance that the same tests on a second specimen name an effect that acts.
  double repeat_names_alone = 0;
  std::vector<std::pair<std::string, std::string>> not_excitable{};  ///< effect, why
  std::map<std::string, int> runs{};                                 ///< by stage
  /// Of another campaign's design and its base, which they rest on; or with effects, of tables of
  /// runs made elsewhere.
  int borrowed_runs = 0;
  std::vector<NumericalChange> numerics{};  ///< whose runs came to their ends
  std::vector<std::string> warnings{};
  std::string sentence{};  ///< the verdict in words
};

/// What it is made of. Entries as in Race: strengths of one effect are merged here.
struct AnswerParts {
  std::vector<std::string> effect_of{};          ///< K: name of the effect of each entry
  std::vector<inference::EffectModel> models{};  ///< of entries
  /// Under each width, the reference first.
  std::vector<inference::EffectProbabilities> widths{};
  std::vector<Eigen::VectorXd> beyond{};         ///< BeyondDesign under each, K
  Eigen::MatrixXd angles{};                      ///< K x K, degrees
  std::vector<std::pair<int, int>> kin{};        ///< entries
  std::map<std::string, double> verification{};  ///< by effect; not there: no runs were made
  bool verified = false;                         ///< false: nothing had to be verified
  double adequacy_p = 1;
  /// Chance of the misfit of each model; 1 where it was not asked for.
  std::vector<double> chance{};
  double level = 0.01;  ///< of the adequacy test
};

/// AnswerVerdict, levels, families, words; candidates without strengths. In this order: the most
/// probable model has effects and every one is named: missing_effect; the base model passes the
/// adequacy test: adequate; none of these at AnswerLevels::unexplained or no model passes:
/// unexplained; else ambiguous. Errors: INVALID_ARGUMENT for sizes that do not fit.
absl::StatusOr<Answer> AnswerFrom(const AnswerParts& parts,
                                  const inference::AnswerLevels& levels = {});

/// The verdict in one or two sentences.
std::string VerdictInWords(const Answer& answer);

}  // namespace calib::diagnosis
