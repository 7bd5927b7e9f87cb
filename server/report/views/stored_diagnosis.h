#pragma once
// A diagnosis as it was kept at the server: the JSON document of `calibctl diagnose`, read back for
// people.

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"

namespace calib::report {

/// What an effect would change of one measured curve.
struct EffectCurve {
  std::string experiment{}, observable{};
  std::vector<double> change{};  ///< at each reading: model with the effect less model without, SI
};

/// Effects that act together, and how probable that is. None: the model as it is.
struct ProbableEffects {
  std::vector<std::string> effects{};
  double probability = 0;
};

/// Evidence of a model: the diagnosed one with these effects.
struct EvidenceOfEffects {
  std::vector<std::string> effects{};
  double log_evidence = 0, log_evidence_se = 0;
};

/// An effect that was tried on the model.
struct TriedEffect {
  std::string effect{};
  std::optional<double> probability{};  ///< that it acts; none in records of earlier rules
  bool alone = false;                   ///< named
  std::vector<EffectCurve> curves{};
  /// Of the likelihood ratio; in records of earlier rules of the screen, adjusted for the number of
  /// candidates.
  double p_value = 1;
  double explained_fraction = 0;  ///< share of the misfit beyond noise and scatter, 0 to 1
  double predicted_rms_error = 0;
  std::map<std::string, double>
      amplitude{};  ///< dotted parameter -> strength [StoredDiagnosis::units]
  std::vector<std::string> confusable_with{};
  std::map<std::string, double> angles{};  ///< to the other effects [degrees]
  std::optional<double> refit_p_value{}, left_out_error{};
  std::optional<double> advantage_nats{};  ///< gain of the refit over the model without the effect
};

/// A measurement that could be made next.
struct StoredProposal {
  std::string in_words{};
  double decides = 0;  ///< probability of one answer, and that it is right
  double bits = 0;     ///< expected about which model is right
};

struct StoredDiagnosis {
  std::string campaign{};
  std::string digest{};  ///< SHA-256 of the document
  std::int64_t created_unix_ms = 0;
  std::string verdict{};  ///< adequate | missing_effect | ambiguous | unexplained
  std::string effect{};   ///< named, with missing_effect
  /// Models by probability, the largest first; "other" stands for those that are not listed. Empty
  /// in records of earlier rules.
  std::vector<ProbableEffects> probabilities{};
  /// By one likelihood, of the base model, of each effect alone and of what is probable; empty
  /// where no effect was tried, and in older records.
  std::vector<EvidenceOfEffects> evidences{};
  double none_of_these = 0;  ///< probability; with those of the models it sums to one
  /// The fewest models that hold 95 %; "none_of_these" may be one.
  std::vector<std::vector<std::string>> credible_set{};
  std::vector<ProbableEffects> families{};     ///< hardly told apart by these tests
  std::optional<double> repeat_names_alone{};  ///< probability that a second specimen names one
  std::string sentence{};                      ///< the verdict in words
  bool only_adequacy = false;                  ///< no effect was tried
  double rms = 0;                              ///< error of the best fit, in sd of a measurement
  double chi2 = 0, degrees = 0, p_value = 1;
  std::optional<double> p_chi2{}, p_stages{};  ///< p_value is of both together
  std::optional<double> left_out_error{};
  std::vector<TriedEffect> candidates{};  ///< best first
  std::map<std::string, std::string> units{};
  std::vector<std::pair<std::string, std::string>> not_excitable{};  ///< effect, why
  std::map<std::string, std::map<std::string, double>> detectable{};
  std::vector<std::pair<std::string, std::string>> undetectable{};  ///< effect, why
  std::vector<std::string> warnings{};
  std::string next_experiment{};  ///< the lines for the campaign file; empty: none was planned
  std::string next_in_words{};    ///< the test and what is set; empty in older records
  std::vector<std::string> next_separates{};
  double next_power = 0;
  std::vector<std::pair<std::string, std::string>> next_together{};  ///< that it does not separate
  /// What was foretold by runs, best first, the next experiment the first of them; empty in records
  /// of earlier rules.
  std::vector<StoredProposal> proposals{};
  std::string then_file{};  ///< of a further measurement that the answer knows; empty: of none
};

/// INVALID_ARGUMENT when the text is no such document; fields of other versions are left out.
absl::StatusOr<StoredDiagnosis> ReadDiagnosis(const std::string& json);

/// The diagnosis of a campaign to show among several: the latest that tried effects, else the
/// latest; of equal verdicts the one that planned the next experiment. nullptr: there is none of
/// the campaign.
const StoredDiagnosis* LatestOf(const std::vector<StoredDiagnosis>& diagnoses,
                                const std::string& campaign);

/// "p = 0.42", or with what it is made of: "p = 0.03; of means and trends of the stages 0.002;
/// together 0.006".
std::string PValuesInWords(double p_value, std::optional<double> p_chi2,
                           std::optional<double> p_stages);

/// "stiffness = 8.2 kN m/rad, friction = 0.1", in the units given by dotted parameter.
std::string StrengthInWords(const std::map<std::string, double>& amplitude,
                            const std::map<std::string, std::string>& units);

}  // namespace calib::report
